"""`descentflow watch`: whether the difference between a simulator and real flights has changed."""

import json
import sys
from pathlib import Path

from descentflow.cli.options import pairs

NEW_ALARM = 3
"""Exit status of a run that raises an alarm."""


def run(
    simulator: str,
    days: Path,
    *,
    state: Path,
    typecode: str | None = None,
    bada_dir: Path | None = None,
    column: list[str] | None = None,
    reference_days: int = 30,
    false_alarms: float = 0.05,
    accept: bool = False,
) -> int:
    """Watch a simulator by days of real flights, and raise an alarm when their difference has changed.

    Prints a line of JSON for each new day, then the answer on stderr. The state folder keeps one line a day and a page,
    and no flights. Exit status: 0, or 3 for a new alarm.

    Args:
        simulator: checkpoint, flights of any simulator (prepared descents are read fastest), or the designator of a
            type, for instance A320
        days: a file of rows or prepared descents, or a folder that fills with such files
        state: folder of the watch, made if absent
        typecode: for a simulator's flights: the type whose coefficients carry the rate from one airspeed to another
        bada_dir: folder of BADA 3 or 4 (default: open aircraft)
        column (NAME=COLUMN): column of the rows' tables for a name of the rows; may be given again
        reference_days: first days, between which the scatter is learnt and no change is sought
        false_alarms: rate of false alarms a year, over everything that is watched
        accept: take the change that stands as the new reference first
    """
    from descentflow.core.progress import stage
    from descentflow.watching.watch import watch

    with stage("opening") as shown:
        watched = watch(
            simulator,
            days,
            state=state,
            typecode=typecode and typecode.upper(),
            bada_dir=bada_dir,
            columns=pairs("--column", column or []),
            reference_days=reference_days,
            false_alarms=false_alarms,
            accept=accept,
            progress=shown.say,
        )
    for line in watched.new_days:
        print(json.dumps(line))
    print(watched, file=sys.stderr)
    return NEW_ALARM if watched.is_new else 0
