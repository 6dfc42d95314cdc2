"""The error for a table that lacks columns of a row: what it has, what it may be, and where to get what is missing."""

from collections.abc import Sequence
from pathlib import Path

from descentflow.core.errors import DataError
from descentflow.surveillance.rows.schema import REQUIRED

MOST_NAMED = 20
"""Columns that are named; an OpenSky state vector has 17."""
STATE_VECTOR = "baroaltitude"
"""Column that only OpenSky's state vectors have; they are in SI units."""
OF_SAMPLES = {"sample_id", "level_fl"}
"""Columns by which a table of `descentflow sample` is known: it has levels and no reports."""
OF_DESCENTS = {"flight_id", "level_fl", "time_s"}
"""Columns by which prepared descents are known."""
COLUMNS_MEND = (
    "name yours, for instance --column altitude=alt_ft of `descentflow prepare`, or rename it; IAS comes with Mode S "
    "enhanced surveillance (BDS 6,0), not with ADS-B alone, and Mach with it; one of the two is computed from the other"
)
VECTORS_MEND = (
    "take airspeeds from OpenSky's replies to Mode S radars (rawdata or the roll-call tables; docs: Sources of rows, "
    "Airspeeds from OpenSky), and pass these replies: state vectors have none"
)
SAMPLES_MEND = (
    "pass the checkpoint itself in place of its samples, or export them as flights (descentflow export --to traffic)"
)
DESCENTS_MEND = (
    "these are prepared descents: pass the file that `descentflow prepare` wrote to fit, evaluate, diagnose or "
    "predict-descent (saved again by another program it lacks how it was prepared: select flights among the rows, or "
    "in Python by read_descents, Descents and write_descents), and to prepare the rows that they were made of"
)


def listed(names: Sequence[str]) -> str:
    """Names of columns for a message, not too many.

    Example:
        >>> listed(["a", "b"]), listed(["c"] * 30)[-13:]
        ('a, b', 'c and 10 more')
    """
    more = f" and {len(names) - MOST_NAMED} more" if len(names) > MOST_NAMED else ""
    return ", ".join(names[:MOST_NAMED]) + more


def without_columns(path: Path | str, missing: Sequence[str], theirs: Sequence[str], named: Sequence[str]) -> DataError:
    """The error for a table without these columns.

    Args:
        path: The table's name.
        missing: Columns of a row that it lacks.
        theirs: Its columns, as it names them.
        named: The same in names of a row.

    Example:
        >>> print(without_columns("d.parquet", ["altitude"], ["flight_id", "level_fl", "time_s"], list(OF_DESCENTS)))
        d.parquet has no column altitude (it has flight_id, level_fl, time_s); expected ... these are prepared ...
    """
    mend = COLUMNS_MEND
    if set(named) >= OF_SAMPLES:
        mend = SAMPLES_MEND
    elif set(named) >= OF_DESCENTS:
        mend = DESCENTS_MEND
    elif STATE_VECTOR in theirs:
        mend = VECTORS_MEND
    return DataError(
        f"{path} has no column {', '.join(missing)} (it has {listed(theirs)})",
        expected=f"columns {', '.join(REQUIRED)}, named as the traffic library names them",
        mend=mend,
    )
