"""Split descents by flight or by aircraft, before anything is fitted."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from jsonargparse.typing import ClosedUnitInterval

from descentflow.core.arguments import NotNegativeInt, checked_settings
from descentflow.core.errors import DataError
from descentflow.representation.representation import Split


@checked_settings
@dataclass(frozen=True)
class SplitSettings:
    """Flights that are held out, before anything is fitted.

    Attributes:
        test_fraction: Share of the flights held out for test; with zero, none are.
        validation_fraction: Share of the other flights held out for validation; with zero, the training flights serve
            for it.
        split_by: What the split never tears apart: a flight, or an aircraft with all its flights.
        seed: Of the split.

    Example:
        >>> SplitSettings(split_by="aircraft").test_fraction
        0.2
    """

    test_fraction: ClosedUnitInterval = 0.2
    validation_fraction: ClosedUnitInterval = 0.1
    split_by: Literal["flight", "aircraft"] = "flight"
    seed: NotNegativeInt = 0


def split_flights(
    flight_ids: Sequence[str],
    groups: Sequence[str],
    settings: SplitSettings = SplitSettings(),
) -> Split:
    """Assign whole groups of flights to train, validation and test (paper, section 3: 80:20 before the fPCA).

    Args:
        flight_ids: One identifier per flight.
        groups: The group of each flight, whose flights stay in one part: the flight itself, or its aircraft.
        settings: Shares of the groups. The same identifiers, in any order, and the same seed give the same split.

    Raises:
        DataError: If a part would be empty, or training would have fewer than two flights.

    Example:
        >>> ids = [f"flight {number}" for number in range(10)]
        >>> split = split_flights(ids, ids)
        >>> len(split.train), len(split.validation), len(split.test)
        (7, 1, 2)
    """
    names = sorted(set(groups))
    order = np.random.default_rng(settings.seed).permutation(len(names))
    test_fraction, validation_fraction = settings.test_fraction, settings.validation_fraction
    n_test = max(round(test_fraction * len(names)), 1) if test_fraction > 0 else 0
    n_validation = max(round(validation_fraction * (len(names) - n_test)), 1) if validation_fraction > 0 else 0
    part_of = {names[i]: 0 if k < n_test else 1 if k < n_test + n_validation else 2 for k, i in enumerate(order)}
    parts: tuple[list[str], list[str], list[str]] = ([], [], [])
    for flight, group in zip(flight_ids, groups, strict=True):
        parts[part_of[group]].append(flight)
    test, validation, train = (tuple(sorted(part)) for part in parts)
    wanted = (test, test_fraction), (validation, validation_fraction)
    if len(train) < 2 or any(share > 0 and not part for part, share in wanted):
        raise DataError(
            f"{len(flight_ids)} flight(s) in {len(names)} group(s), too few to split",
            expected="at least two flights to train on and one each to validate and to test",
            mend="prepare more descents (a useful generator needs hundreds)",
        )
    return Split(train, validation, test)
