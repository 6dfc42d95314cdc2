"""Kind of speed that flights hold: as asked for, or as the training flights show it."""

from collections.abc import Callable
from typing import Literal, TypeVar

from descentflow.representation.fpca.constant_basis import can_be_fitted
from descentflow.representation.observed_channels import observed_speeds
from descentflow.representation.profiles import Profiles, Speed

T = TypeVar("T")
HeldSpeed = Literal["auto", "cas", "mach_cas"]
"""Choices of the option: ``auto`` takes a Mach number and a CAS where training flights report both."""


def shows_both(train: Profiles) -> bool:
    """True where enough training flights show a Mach number above, and enough a CAS below, to fit both.

    Flights that all hold one and the same Mach number, as some simulators fly, leave nothing to fit.

    Args:
        train: With crossovers.

    Example:
        >>> from descentflow.aircraft_types.registry import aircraft
        >>> from descentflow.representation.profiles import profiles_from_frame
        >>> import polars as pl
        >>> frame = pl.read_parquet("descents.parquet")
        >>> grids = ((150, 350), (150, 200))
        >>> [shows_both(profiles_from_frame(frame, aircraft("A320"), *grid, speed="mach_cas")) for grid in grids]
        [True, False]
    """
    speeds = zip(*observed_speeds(train, "mach_cas"), strict=True)
    return all(can_be_fitted(values, seen) for values, seen in speeds)


def as_held(
    speed: HeldSpeed, make: Callable[[Speed], T], train_of: Callable[[T], Profiles], say: Callable[[str], None]
) -> T:
    """Flights with their speed held as asked for.

    Args:
        speed: What is asked for.
        make: The flights, with their speed held in one way or the other.
        train_of: The training flights among them.
        say: Reports what ``auto`` chose.

    Example:
        >>> as_held("cas", lambda speed: speed, lambda speed: None, print)
        'cas'
    """
    if speed != "auto":
        return make(speed)
    both = make("mach_cas")
    if shows_both(train_of(both)):
        say("speed: a Mach number above each flight's own crossover and a CAS below (data.speed: auto)")
        return both
    say("speed: one CAS profile, for too few training flights show Mach numbers or CAS that differ (data.speed: auto)")
    return make("cas")
