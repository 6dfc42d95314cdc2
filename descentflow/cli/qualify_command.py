"""`descentflow qualify`: whether a simulator descends as real flights do within limits, and the record of it."""

from pathlib import Path

from descentflow.cli.options import one_or_several, pairs


def run(
    *,
    real: list[Path],
    out: Path,
    simulator: list[Path] | None = None,
    limits: str = "part60",
    typecode: str | None = None,
    nearest_type: bool = False,
    any_type: bool = False,
    bada_dir: Path | None = None,
    column: list[str] | None = None,
    simulator_column: list[str] | None = None,
    simulator_name: str | None = None,
    samples: int = 1000,
    seed: int = 0,
) -> None:
    """Judge a simulator by limits: shares of flights inside, means with intervals, the cause, and a record to sign.

    Writes qualification.json and qualification.html. Surveillance supports a distribution of descents; it replaces no
    flight test.

    Args:
        real: rows, or prepared descents (descentflow prepare)
        out: folder for the record
        simulator: checkpoint, of which descents are drawn; or flights of any simulator
        limits: part60 (14 CFR Part 60, Table A2A, 1.d.4), look_ahead (errors of predictions, measured and not judged),
            or a YAML file of your own
        typecode: without --simulator: nominal BADA of this type, for instance A320; with a simulator's flights: the
            type whose coefficients carry the rate from one airspeed to another (default: their own)
        nearest_type: where the type has no coefficients, take those of the nearest type
        any_type: take real flights of all types
        bada_dir: folder of BADA 3 or 4 (default: open aircraft)
        column (NAME=COLUMN): column of the real rows' tables for a name of the rows; may be given again
        simulator_column (NAME=COLUMN): the same of the rows of the simulator's flights
        simulator_name: name of the simulator on the page (default: the simulator)
        samples: descents to draw of a checkpoint
        seed: the same seed gives the same answer
    """
    from descentflow.core.progress import stage
    from descentflow.qualification.qualification_report import FILES
    from descentflow.qualification.qualify import qualify

    with stage("opening") as shown:
        record = qualify(
            one_or_several(real),
            one_or_several(simulator),
            limits=limits,
            typecode=typecode and typecode.upper(),
            nearest_type=nearest_type,
            any_type=any_type,
            bada_dir=bada_dir,
            columns=pairs("--column", column or []),
            simulator_columns=pairs("--simulator-column", simulator_column or []),
            simulator_name=simulator_name,
            samples=samples,
            seed=seed,
            out=out,
            progress=shown.say,
        )
    print(record)
    print(f"wrote {out / FILES[0]} and {out / FILES[1]}")
