"""Flights whose drag is inferred in the air in which they flew."""

from collections.abc import Callable
from dataclasses import replace

import torch

from descentflow.air.energy_in_air import drag_in_air
from descentflow.air.level_air import LevelAir
from descentflow.air.measured_air import FlightAirs
from descentflow.aircraft_types.aircraft import Aircraft
from descentflow.representation.profiles import Profiles


def with_own_air(
    profiles: Profiles, aircraft: Aircraft, airs: FlightAirs, say: Callable[[str], None]
) -> tuple[Profiles, LevelAir]:
    """The flights whose air is known, with their drag in it, and their airs in their order.

    Args:
        profiles: Flights whose drag was inferred in standard air.
        aircraft: Coefficients that inferred it, at the mass that did.
        airs: On the levels of the profiles or more at the top.
        say: Called with a count of the flights of whose air nothing is known: they are left out.

    Example:
        >>> import polars as pl
        >>> from descentflow.air.measured_air import learnt_air, measured_airs
        >>> from descentflow.aircraft_types.registry import aircraft
        >>> from descentflow.representation.profiles import profiles_from_frame
        >>> frame, a320 = pl.read_parquet("descents.parquet"), aircraft("A320")
        >>> profiles = profiles_from_frame(frame, a320, bottom_fl=150, top_fl=340)
        >>> airs = measured_airs(frame, profiles.levels_fl, learnt_air(frame, 150, 340))
        >>> found, air = with_own_air(profiles, a320, airs, print)
        >>> ratio = (found.drag_n / profiles.drag_n)[found.mask]  # the example's flights flew in standard air
        >>> bool((ratio.median() - 1).abs() < 0.005), air.deviation_k.shape
        (True, torch.Size([120, 191]))
    """
    place = {flight: i for i, flight in enumerate(airs.flight_ids)}
    known = [i for i, flight in enumerate(profiles.flight_ids) if flight in place]
    if len(known) < len(profiles):
        say(f"left out {len(profiles) - len(known)} of {len(profiles)} flight(s) of whose air nothing is known")
    chosen = profiles.subset(known)
    air = airs.air.rows([place[flight] for flight in chosen.flight_ids]).levels(0, len(profiles.levels_fl))
    drag_n = drag_in_air(aircraft, chosen.cas_mps, chosen.rate_mps, chosen.drag_n, chosen.altitude_m, air)
    return replace(chosen, drag_n=torch.where(chosen.mask, drag_n, 0.0)), air
