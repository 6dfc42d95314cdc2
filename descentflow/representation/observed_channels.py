"""Observed profiles of flights, which their weights explain: the one place that names them."""

from typing import NamedTuple

from torch import Tensor

from descentflow.core.errors import ConfigError
from descentflow.physics.airspeed import cas_to_mach
from descentflow.representation.drag_scale import DragScale
from descentflow.representation.profiles import Profiles, Speed


class Observed(NamedTuple):
    """The profiles of n flights that their weights explain, in the order of the weights: each (n, L) with its mask.

    Example:
        >>> import polars as pl
        >>> from descentflow.representation.encode_flights import encode_flights
        >>> from descentflow.representation.read_checkpoint import load_representation
        >>> known = load_representation("best.ckpt")
        >>> flights = encode_flights(pl.read_parquet("descents.parquet"), known)["test"].profiles
        >>> len(known.decoder.observed(flights).values)  # drag and CAS
        2
    """

    values: tuple[Tensor, ...]
    masks: tuple[Tensor, ...]


def observed_channels(flights: Profiles, speed: Speed, drag_scale: DragScale) -> Observed:
    """Observed values of each profile, in the order of the weights.

    Args:
        flights: With crossovers where speed is held as Mach and CAS, and without where it is one CAS profile.
        speed: How it is held.
        drag_scale: On which drag is linear in the weights.

    Raises:
        ConfigError: If the flights are of the other way.

    Example:
        >>> from descentflow.aircraft_types.registry import aircraft
        >>> from descentflow.representation.profiles import profiles_from_frame
        >>> import polars as pl
        >>> frame = pl.read_parquet("descents.parquet")
        >>> flights = profiles_from_frame(frame, aircraft("A320"), 150, 330, speed="mach_cas")
        >>> from descentflow.representation.drag_scale import fit_drag_scale
        >>> drag, mach, cas = observed_channels(flights, "mach_cas", fit_drag_scale(flights, aircraft("A320"))).masks
        >>> bool((mach & cas).any()), bool(mach.any()), bool((drag == flights.mask).all())
        (False, True, True)
    """
    speeds = observed_speeds(flights, speed)
    return Observed((drag_scale.scaled(flights.drag_n, flights.cas_mps), *speeds.values), (flights.mask, *speeds.masks))


def observed_speeds(flights: Profiles, speed: Speed) -> Observed:
    """Observed values of the speeds alone, see :func:`observed_channels`."""
    if (flights.crossovers is None) is (speed == "mach_cas"):
        raise ConfigError(
            f"flights whose speed is {'one CAS profile' if speed == 'mach_cas' else 'a Mach number and a CAS'}",
            expected=f"flights of speed={speed!r}, as the model has it",
            mend=f"make their profiles with speed={speed!r}",
        )
    if flights.crossovers is None:
        return Observed((flights.cas_mps,), (flights.mask,))
    seen, at_mach = flights.mask & flights.crossovers.sure, flights.crossovers.holds_mach
    mach = cas_to_mach(flights.cas_mps, flights.altitude_m)
    return Observed((mach, flights.cas_mps), (seen & at_mach, seen & ~at_mach))
