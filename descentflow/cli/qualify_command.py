"""`descentflow qualify`: whether a simulator descends as real flights do within limits, and the record of it."""

from pathlib import Path
from typing import Unpack

from descentflow.cli.options import Sides, of_sides, one_or_several


def run(
    *,
    real: list[Path],
    out: Path,
    simulator: list[Path] | None = None,
    limits: str = "part60",
    samples: int = 1000,
    seed: int = 0,
    **sides: Unpack[Sides],
) -> None:
    """Judge a simulator by limits: shares of flights inside, means with intervals, the cause, and a record to sign.

    Writes qualification.json and qualification.html. Surveillance supports a distribution of descents; it replaces no
    flight test.

    Args:
        real: rows, or prepared descents (descentflow prepare)
        out: folder for the record
        simulator: checkpoint, of which descents are drawn; flights of any simulator; or a predictor's table of times
            for the real flights (flight_id, level_fl, time_s)
        limits: part60 (14 CFR Part 60, Table A2A, 1.d.4), look_ahead (errors of predictions, measured and not judged),
            or a YAML file of your own
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
            samples=samples,
            seed=seed,
            out=out,
            progress=shown.say,
            **of_sides(sides),
        )
    print(record)
    print(f"wrote {out / FILES[0]} and {out / FILES[1]}")
