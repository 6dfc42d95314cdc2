"""What `evaluate` and `diagnose` do with flights that are known by times and altitudes alone."""

import argparse
from collections.abc import Sequence
from pathlib import Path
from typing import Any


def run(
    real: Path, simulator: Any, args: argparse.Namespace, unused: Sequence[str], *, names_causes: bool = False
) -> None:
    """Compare times between levels, write and print.

    Args:
        real: File of so6 segments or of ALL_FT+ flights.
        simulator: As :func:`~descentflow.diagnosis.level_times.compare_times.compare_times` takes it.
        args: Of the command.
        unused: Names of its options that have no meaning here.
        names_causes: Whether the command would name causes: it then says which cannot be told apart.

    Raises:
        ConfigError: If an option without meaning is given, or there is no simulator.
    """
    from descentflow.core.errors import ConfigError
    from descentflow.core.files import check_folder
    from descentflow.core.progress import stage
    from descentflow.diagnosis.level_times.compare_times import compare_times
    from descentflow.diagnosis.level_times.times_page import FILES, write_times
    from descentflow.effects import EFFECTS

    given = [name for name in unused if getattr(args, name, None) is not None]
    if given or simulator is None:
        what = ", ".join(f"--{name.replace('_', '-')}" for name in given) or "no --simulator and no --typecode"
        raise ConfigError(
            f"{what} with points that have times and altitudes alone",
            expected="a simulator, and no option that needs airspeeds",
            mend="name the simulator, or leave the option out; or pass rows with airspeeds",
        )
    check_folder(args.out, *FILES)
    # Those on what is reported of a flight alone do not change how long it takes.
    alike = [one.label or name.replace("_", " ") for name, one in EFFECTS.items() if not one.sensor]
    with stage("comparing times") as shown:
        found = compare_times(
            real,
            simulator,
            n=getattr(args, "number", 10_000),
            seed=args.seed,
            bada_dir=getattr(args, "bada_dir", None),
            alike=alike if names_causes else (),
            progress=shown.say,
        )
    with stage("writing"):
        write_times(found, args.out)
    print(found)
    print(f"wrote {args.out / 'level_times.json'} and {args.out / 'level_times.html'}")
