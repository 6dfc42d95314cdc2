"""Real flights that are the checkpoint's own: that it descends as these do is what it learnt, and no proof of it."""

import warnings

import polars as pl

from descentflow.core.errors import DescentflowWarning
from descentflow.diagnosis.findings.findings import SEEN
from descentflow.representation.seen_flights import SeenFlights


def own_flights(real: pl.DataFrame, name: str, seen: SeenFlights) -> dict[str, int]:
    """Count the real flights that a checkpoint was trained or validated on; they are compared all the same.

    Recognised by aircraft and time: flights of a simulator that flew the same traffic again are not the real ones,
    though both may have the same identifiers.

    Args:
        real: Prepared real descents.
        name: The checkpoint's.
        seen: The flights that it has seen.

    Returns:
        Their number by name; nothing if there are none.

    Warns:
        DescentflowWarning: If they are most of the real flights.

    Example:
        >>> import warnings
        >>> from descentflow.representation.read_checkpoint import load_representation
        >>> frame = pl.read_parquet("descents.parquet")
        >>> with warnings.catch_warnings(record=True) as told:
        ...     warnings.simplefilter("always")
        ...     own_flights(frame, "best.ckpt", load_representation("best.ckpt").seen)
        {'flights_that_the_simulator_has_seen': 96}
        >>> print(told[0].message)
        96 of the 120 real flights are some that best.ckpt was trained or validated on, and are no test of it; ...
    """
    count, total = len(seen.among(real)), real["flight_id"].n_unique()
    if 2 * count > total:
        warnings.warn(
            f"{count:,} of the {total:,} real flights are some that {name} was trained or validated on, and are no "
            "test of it; to learn how it descends beside flights that it has not seen, pass others",
            DescentflowWarning,
            stacklevel=4,
        )
    return {SEEN: count} if count else {}
