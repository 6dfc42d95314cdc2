"""`descentflow simulate`: fly aircraft of known truth and write what a radar would report of them."""

from argparse import ArgumentParser
from collections.abc import Mapping, Sequence
from pathlib import Path

from descentflow.cli.options import pairs
from descentflow.core.errors import ConfigError
from descentflow.simulation.plantable import PLANTABLE, Plantable


def extend(parser: ArgumentParser) -> None:
    """List the effects that can be planted."""
    parser.epilog = listing(PLANTABLE)


def listing(known: Mapping[str, Plantable]) -> str:
    """Effects with their values, units and defaults.

    Example:
        >>> print(listing({"measurement_noise": PLANTABLE["measurement_noise"]}))
        effects that --plant knows, and their values with defaults:
          measurement_noise: noisier reports of all fields
            factor=3 factor of every standard deviation
    """
    lines = ["effects that --plant knows, and their values with defaults:"]
    for name, effect in known.items():
        lines += [f"  {name}: {effect.description}", *(f"    {value.text}" for value in effect.values)]
    return "\n".join(lines)


def run(
    *,
    out: Path,
    typecode: str = "A320",
    flights: int = 2000,
    seed: int = 0,
    scenario: str = "plain",
    truth: Path | None = None,
    bada_dir: Path | None = None,
    plant: list[str] | None = None,
    days: int | None = None,
    change: list[str] | None = None,
    without_airspeeds: bool = False,
    wind_error_mps: float = 2.5,
) -> None:
    """Fly descents of one aircraft type by the full equation of motion.

    There are operators of different schedules, spread of mass, thrust and drag, level-offs and constant-rate stretches.
    The rows that a Mode S radar would report of them are written, and in the same folder the truth behind them:
    OUT_truth.parquet, a row per flight and time step, and OUT_flights.parquet, a row per flight with every parameter
    and what was planted.

    Args:
        out: output: surveillance rows, .parquet
        typecode: aircraft type
        flights: flights wanted
        seed: the same seed gives the same flights
        scenario: settings of the world by type: plain, london-fir-2019 (the traffic that the paper describes: operators
            of different speeds, slow first stretches, turboprops of two rates), gulf-summer and nordic-winter (other
            air, operators and habits, to judge models on), or a TOML file
        truth: where to put the truth (default: OUT_truth.parquet)
        bada_dir: folder of BADA 3 or 4 with the type's coefficients (default: the open aircraft)
        plant (EFFECT): effect to plant in the flights, with its values as EFFECT:VALUE=NUMBER,..., again for each one:
            temperature:deviation_k=10,spread_k=4 (see below)
        days: spread the flights over so many days; OUT is then a folder with a file of rows for each
        change (DATE EFFECT): with --days: effect that flights have from a date on, in place of --plant, as
            "2024-03-24 drag_polar:factor=1.05"; may be given again
        without_airspeeds: leave IAS, Mach, TAS and heading out, as plain ADS-B does, and write the weather field to
            derive them by, with errors, to OUT_field.nc
        wind_error_mps: standard error of each component of the field's wind; its temperature errs by 0.4 K for each m/s
    """
    from descentflow.core.progress import stage
    from descentflow.simulation.days import simulate_days
    from descentflow.simulation.world import field_file, simulate, world_files

    effects = planted(plant or [])
    if days is not None and without_airspeeds:
        raise ConfigError("--days with --without-airspeeds", expected="one of them", mend="leave out the other")
    if days is not None:
        dated = (word.strip().partition(" ") for word in change or [])
        changes = {day: planted(words.split()) for day, _, words in dated}
        with stage("flying", flights * (1 + len(changes)), "flights") as flown:
            written = simulate_days(typecode, flights, days, out, seed=seed, scenario=scenario, bada_dir=bada_dir,
                                    plant=effects, changes=changes, progress=flown.advance)  # fmt: skip
        print(f"wrote {len(written)} days to {out}")
        return
    if change:
        raise ConfigError("--change without --days", expected="both", mend="say over how many days flights are spread")
    with stage("flying", flights, "flights") as flown:
        world = simulate(typecode, flights, seed, scenario, bada_dir=bada_dir, plant=effects, out=out, truth_out=truth,
                         without_airspeeds=without_airspeeds, wind_error_mps=wind_error_mps,
                         progress=flown.advance)  # fmt: skip
    print(world)
    rows, beside, flown_truth = world_files(out, truth)
    print(f"wrote {rows}, {flown_truth}, {beside}{f', {field_file(out)}' if without_airspeeds else ''}")


def planted(words: Sequence[str]) -> dict[str, dict[str, float]]:
    """Values by the name of the effect.

    Args:
        words: Each `EFFECT` or `EFFECT:VALUE=NUMBER,...`.

    Raises:
        ConfigError: If a word is no such thing, or an effect or a value comes twice. Whether there is such an effect is
            asked where it is planted.

    Example:
        >>> planted(["temperature:deviation_k=10,spread_k=4", "mass"])
        {'temperature': {'deviation_k': 10.0, 'spread_k': 4.0}, 'mass': {}}
    """
    causes: dict[str, dict[str, float]] = {}
    for word in words:
        name, _, rest = word.partition(":")
        try:
            values = {
                parameter: float(number)
                for parameter, number in pairs("--plant", rest.split(",") if rest else []).items()
            }
        except ValueError as error:
            raise ConfigError(f"--plant {word}: {error}", expected="VALUE=NUMBER", mend="correct the number") from error
        if name in causes or "=" in name:
            raise ConfigError(
                f"--plant {word}", expected="EFFECT:VALUE=NUMBER,..., each effect once", mend="correct it"
            )
        causes[name] = values
    return causes
