"""Flights in their parts: what trains, what validates, what tests."""

from collections.abc import Callable, Mapping
from typing import Literal

import torch

from descentflow.core.errors import DataError
from descentflow.representation.profiles import Profiles
from descentflow.representation.representation import Split

Part = Literal["train", "validation", "test"]
PARTS: tuple[Part, ...] = ("train", "validation", "test")
FEWEST_ON_A_LEVEL = 2
"""Training flights that must show a level: of one there is no variance."""
Top = Literal["shown", "quarter"]
"""End of the grid: the highest level that enough flights reach, or a quarter of them, as in the paper."""
ENOUGH_FLIGHTS, ENOUGH_SHARE = 20, 50
"""Training flights that reach the end of the grid: so many, and one in so many."""


def top_level(train: Profiles, among: list[int] | None = None, top: Top = "shown") -> int:
    """Highest flight level that enough of the training flights reach: a quarter, or 20 and 2 % if these are fewer.

    Args:
        train: Training flights.
        among: Which flights of it they are; all if absent.
        top: ``shown``, or ``quarter`` for a quarter in any case (paper, appendix A).

    Example:
        >>> from descentflow.aircraft_types.registry import aircraft
        >>> from descentflow.representation.profiles import profiles_from_frame
        >>> from descentflow.surveillance.descents.prepared_descents import read_descents
        >>> flights = profiles_from_frame(read_descents("descents.parquet").frame, aircraft("A320"), 150)
        >>> top_level(flights) >= top_level(flights, top="quarter")
        True
    """
    entry = train.entry_level if among is None else train.entry_level[among]
    entries = train.levels_fl[entry].sort(descending=True).values
    quarter, enough = -(-len(entries) // 4), max(ENOUGH_FLIGHTS, -(-len(entries) // ENOUGH_SHARE))
    return int(entries[(quarter if top == "quarter" else min(quarter, enough)) - 1])


def levels_shown(train: Profiles) -> tuple[float, float]:
    """Ends (flight levels) of the part of the grid of which two training flights or more show every level.

    Of several such parts, with gaps between them, it is the one that shows most.

    Args:
        train: Training flights.

    Raises:
        DataError: If no two of them show any level, or one level alone.

    Example:
        >>> from descentflow.aircraft_types.registry import aircraft
        >>> from descentflow.representation.profiles import profiles_from_frame
        >>> from descentflow.surveillance.descents.prepared_descents import read_descents
        >>> levels_shown(profiles_from_frame(read_descents("descents.parquet").frame, aircraft("A320"), 150))
        (150.0, 383.0)
    """
    counts = train.mask.sum(0)
    shown = counts >= FEWEST_ON_A_LEVEL
    # Levels of one part have as many levels below them that are not shown.
    part = torch.where(shown, (~shown).cumsum(0), -1)
    parts = [part == number for number in sorted(set(part[shown].tolist()))]
    best = max(parts, key=lambda flight: int(counts[flight].sum()), default=shown)
    levels = train.levels_fl[best]
    if len(levels) < 2:
        raise DataError(
            f"{len(train)} training flights, of which no two show the same levels",
            expected="levels, one after the other, that two training flights or more show",
            mend="prepare more descents",
        )
    return float(levels[0]), float(levels[-1])


def rest_is_test(flight_ids: tuple[str, ...], split: Split, known_as: Mapping[str, str] | None = None) -> Split:
    """The split of other flights by a model's: those that it never saw are test flights.

    Args:
        flight_ids: Identifiers of the flights.
        split: The model's.
        known_as: Part of the flights that the model saw under another identifier, see
            :meth:`.seen_flights.SeenFlights.among`.

    Example:
        >>> rest_is_test(("a", "c", "e"), Split(train=("a", "b"), validation=("c",), test=("d",)))
        Split(train=('a',), validation=('c',), test=('e',))
        >>> rest_is_test(("a", "b2"), Split(train=("a", "b"), validation=(), test=()), {"b2": "train"})
        Split(train=('a', 'b2'), validation=(), test=())
    """
    part = {**(known_as or {}), **dict.fromkeys(split.validation, "validation"), **dict.fromkeys(split.train, "train")}
    return Split(*(tuple(f for f in flight_ids if part.get(f, "test") == name) for name in PARTS))


def with_levels(profiles: Profiles, say: Callable[[str], None]) -> Profiles:
    """The flights that have two levels or more on the grid.

    Args:
        profiles: Flights on the grid.
        say: Called with a line that counts the others, if there are any.

    Example:
        >>> from descentflow.aircraft_types.registry import aircraft
        >>> from descentflow.representation.profiles import profiles_from_frame
        >>> from descentflow.surveillance.descents.prepared_descents import read_descents
        >>> flights = profiles_from_frame(read_descents("descents.parquet").frame, aircraft("A320"), 150)
        >>> len(flights), len(with_levels(flights.between(150, 150), print))  # one level is left
        left out 120 flight(s) with fewer than two levels on the grid
        (120, 0)
    """
    enough = profiles.mask.sum(1) >= 2
    if not bool(enough.all()):
        say(f"left out {int((~enough).sum())} flight(s) with fewer than two levels on the grid")
        return profiles.subset(torch.nonzero(enough)[:, 0])
    return profiles


def parts_of(profiles: Profiles, split: Split) -> dict[Part, Profiles]:
    """Profiles of each part; a split may name flights that are not among them.

    Example:
        >>> from descentflow.aircraft_types.registry import aircraft
        >>> from descentflow.representation.profiles import profiles_from_frame
        >>> from descentflow.surveillance.descents.prepared_descents import read_descents
        >>> flights = profiles_from_frame(read_descents("descents.parquet").frame, aircraft("A320"), 150)
        >>> first, second, *rest = flights.flight_ids
        >>> parts = parts_of(flights, Split(train=tuple(rest), validation=(first,), test=(second, "not there")))
        >>> {part: len(profiles) for part, profiles in parts.items()}
        {'train': 118, 'validation': 1, 'test': 1}
    """
    return {part: one_part(profiles, split, part) for part in PARTS}


def one_part(profiles: Profiles, split: Split, part: Part) -> Profiles:
    """Profiles of one part alone, see :func:`parts_of`.

    Example:
        >>> from descentflow.aircraft_types.registry import aircraft
        >>> from descentflow.representation.profiles import profiles_from_frame
        >>> from descentflow.surveillance.descents.prepared_descents import read_descents
        >>> flights = profiles_from_frame(read_descents("descents.parquet").frame, aircraft("A320"), 150)
        >>> len(one_part(flights, Split(train=flights.flight_ids[1:], validation=(), test=()), "train"))
        119
    """
    return profiles.subset(places(profiles, split, part))


def places(profiles: Profiles, split: Split, part: Part) -> list[int]:
    """Indices of a part's flights among profiles, in the order of the split.

    Example:
        >>> from descentflow.aircraft_types.registry import aircraft
        >>> from descentflow.representation.profiles import profiles_from_frame
        >>> from descentflow.surveillance.descents.prepared_descents import read_descents
        >>> flights = profiles_from_frame(read_descents("descents.parquet").frame, aircraft("A320"), 150)
        >>> places(flights, Split(train=flights.flight_ids[1::-1], validation=(), test=()), "train")
        [1, 0]
    """
    named = {"train": split.train, "validation": split.validation, "test": split.test}[part]
    position = {flight: i for i, flight in enumerate(profiles.flight_ids)}
    return [position[f] for f in named if f in position]
