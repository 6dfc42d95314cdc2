"""Effects put into the flights of a simulator: rates, speeds and reports on every level, and times integrated again."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
import torch
from torch import Tensor

from descentflow.core.counter_random import DrawNumbers
from descentflow.core.units import FL_M, FPM_MPS, FT_M, KT_MPS
from descentflow.diagnosis.correction._flight_gaps import with_gaps
from descentflow.diagnosis.sides.two_sides import Compared
from descentflow.effects import Effect
from descentflow.effects.effects_together import changes_together, slope_over_levels
from descentflow.effects.flight_state import SLOWEST_MPS, FlightState, log_rate
from descentflow.measurements.along_track import drift_cosine, level_part_kt
from descentflow.measurements.level_channels import LevelGrid
from descentflow.physics.airspeed import cas_to_mach, mach_to_tas_mps
from descentflow.physics.performance_model import PerformanceModel
from descentflow.surveillance.cleaning.thresholds import Cleaning


@dataclass(frozen=True)
class AddedEffects:
    """Effects that are put into flights.

    Attributes:
        catalogue: Effects by name.
        theta: Parameters of those that are put in.
        mass_kg: Mass at which their signatures are taken.
        cleaning: Settings by which the flights were cleaned: they say where descents begin and what rate ends them.
        seed: By which an effect takes its share of the flights.

    Example:
        >>> from descentflow.effects import EFFECTS
        >>> AddedEffects(EFFECTS, {"temperature": torch.tensor([10.0])}, 60e3, Cleaning(), seed=0).mass_kg
        60000.0
    """

    catalogue: Mapping[str, Effect]
    theta: Mapping[str, Tensor]
    mass_kg: float
    cleaning: Cleaning
    seed: int

    def changes(self, state: FlightState) -> tuple[dict[str, Tensor], dict[str, Tensor]]:
        """Changes of a simulator's flights that are flown, and that are reported alone; shares are exact."""
        return changes_together(state, self.catalogue, self.theta, DrawNumbers(self.seed), exact_shares=True)


def with_effects(grid: LevelGrid, aircraft: PerformanceModel, added: AddedEffects) -> LevelGrid:
    """The flights as the simulator would fly and report them if it had the effects.

    Rates, CAS, TAS, wind and heights change on every level by what the effects say of the flight's own speed there;
    Mach number, true airspeed and groundspeed follow. Times are integrated again: every leg takes longer by the mean
    factor of its two ends, what a flight lost in a gap stays lost. What sensors add changes reports alone. An effect of
    a share of the flights takes whole flights by seed and number, and leaves the others as they are. Levels on which a
    flight would descend more slowly than the cleaning allows go.

    Args:
        grid: Flights on levels.
        aircraft: Whose coefficients give the signatures.
        added: What is put in.

    Example:
        >>> from descentflow.aircraft_types.registry import aircraft
        >>> from descentflow.effects import EFFECTS
        >>> from descentflow.measurements.quantities import CHANNELS, grid_of
        >>> from descentflow.surveillance.descents.prepared_descents import read_descents
        >>> grid = grid_of(read_descents("descents.parquet").frame, 150, 340, CHANNELS)
        >>> warm = AddedEffects(EFFECTS, {"temperature": torch.tensor([10.0])}, 60e3, Cleaning(), seed=0)
        >>> warmer = with_effects(grid, aircraft("A320"), warm)
        >>> round(float((warmer.values["TAS"] / grid.values["TAS"]).nanmean()), 3)  # at the same Mach number
        1.021
    """
    state = state_of_levels(grid, aircraft, added)
    flown, reported = added.changes(state)
    moved = _flown(grid, state, flown)
    moved = with_gaps(moved, flown, DrawNumbers(added.seed), added.cleaning)
    values = _moved(moved, {**reported, "tas": reported["tas"].exp()})
    gone = (values["vertical_rate"] > -added.cleaning.slowest_fpm) & grid.mask
    values = {name: torch.where(gone, torch.nan, value) for name, value in values.items()}
    return replace(moved, time_s=torch.where(gone, torch.nan, moved.time_s), values=values)


def state_of_levels(grid: LevelGrid, aircraft: PerformanceModel, added: AddedEffects) -> FlightState:
    """The flights as effects look at them, each level a band of its own.

    Example:
        >>> from descentflow.aircraft_types.registry import aircraft
        >>> from descentflow.measurements.quantities import CHANNELS, grid_of
        >>> from descentflow.surveillance.descents.prepared_descents import read_descents
        >>> grid = grid_of(read_descents("descents.parquet").frame, 150, 340, CHANNELS)
        >>> state_of_levels(grid, aircraft("A320"), AddedEffects({}, {}, 60e3, Cleaning(), 0)).cas_mps.shape
        torch.Size([120, 191])
    """
    cas = filled(grid.values["IAS"]) * KT_MPS
    top = torch.where(grid.mask, grid.altitude_m, -torch.inf).amax(1, keepdim=True)
    state = FlightState(
        aircraft,
        added.mass_kg,
        grid.altitude_m,
        FL_M,
        cas,
        slope_over_levels(cas),
        _tailwind_mps(grid),
        grid.mask,
        (top - grid.altitude_m).clamp(min=0.0),
        affected=False,
        cleaning=added.cleaning,
    )
    # A held path takes the place of the very rate that was flown.
    flown = (-grid.values["vertical_rate"] * FPM_MPS).clamp(min=SLOWEST_MPS).log()
    return replace(state, beyond_polar=(flown - state.schedule_log_rate).nan_to_num(0.0))


def filled(values: Tensor) -> Tensor:
    """Values (n, L) with the line between their neighbours where they are missing, and the nearest at either end.

    A flight that never reported any has none.

    Example:
        >>> filled(torch.tensor([[torch.nan, 1.0, torch.nan, 3.0], [torch.nan] * 4]).double())
        tensor([[1., 1., 2., 3.],
                [nan, nan, nan, nan]], dtype=torch.float64)
    """
    table = values.double().numpy()
    at = np.arange(table.shape[1])
    rows = [
        np.interp(at, at[seen], row[seen]) if seen.any() else row
        for row, seen in zip(table, np.isfinite(table), strict=True)
    ]
    return torch.from_numpy(np.stack(rows))


def _flown(grid: LevelGrid, state: FlightState, change: dict[str, Tensor]) -> LevelGrid:
    """The flights flown otherwise; reports follow what is flown."""
    before, after = (cas_to_mach(state.cas_mps + x * KT_MPS, grid.altitude_m) for x in (0.0, change["cas"]))
    ratio = mach_to_tas_mps(after, grid.altitude_m) / mach_to_tas_mps(before, grid.altitude_m) * change["tas"].exp()
    values = _moved(grid, {**change, "tas": ratio})
    # Differences, so that what the simulator itself adds to its reports stays.
    if "Mach" in values:
        values["Mach"] = values["Mach"] + after - before
    if "groundspeed" in values:
        tas_kt = mach_to_tas_mps(before, grid.altitude_m) / KT_MPS
        if "TAS" in values:
            reported_kt = filled(grid.values["TAS"])
            # Receivers lack the TAS of flights that never sent it.
            tas_kt = torch.where(reported_kt.isfinite(), reported_kt, tas_kt)
        before_kt = level_part_kt({**grid.values, "TAS": tas_kt})
        gained_kt = level_part_kt({**values, "TAS": tas_kt * ratio}) - before_kt
        wind_kt = change["wind"] / KT_MPS
        values["groundspeed"] = values["groundspeed"] + gained_kt * drift_cosine({**values, "TAS": tas_kt}) + wind_kt
    return replace(grid, values=values, time_s=_times(grid, change["rate"].exp()))


def _times(grid: LevelGrid, factor: Tensor) -> Tensor:
    """Times (n, L) of flights whose rate is larger by a factor (n, L), the same as before at the highest level."""
    legs = grid.legs()
    typical = legs.mean((-grid.values["vertical_rate"] * FPM_MPS).clamp(min=SLOWEST_MPS)).nan_to_num(10.0)
    # In a gap, only as much of the time as the descent takes; from level to level, all of it.
    whole = torch.minimum(legs.elapsed_s, legs.steps * FL_M / typical)
    descending = torch.where(legs.steps > 1, whole, legs.elapsed_s)
    lasts = torch.where(legs.there, descending * legs.mean(1 / factor) + legs.elapsed_s - descending, 0.0)
    fallen = lasts.sum(1, keepdim=True) - lasts.cumsum(1)
    return torch.where(
        grid.mask, torch.where(grid.mask, grid.time_s, torch.inf).amin(1, keepdim=True) + fallen, torch.nan
    )


def _moved(grid: LevelGrid, change: Mapping[str, Tensor]) -> dict[str, Tensor]:
    """Values with a change of rate and CAS, and of TAS (a factor) and height where there are such."""
    values = dict(grid.values)
    values["vertical_rate"] = values["vertical_rate"] * change["rate"].exp()
    values["IAS"] = values["IAS"] + change["cas"]
    if "TAS" in values:
        values["TAS"] = values["TAS"] * change["tas"]
    if "geoaltitude" in values:
        values["geoaltitude"] = values["geoaltitude"] + change["height"] / FT_M
    return values


def _tailwind_mps(grid: LevelGrid) -> Tensor:
    """Along-track wind (n, L); zero where it is not known."""
    if "TAS" not in grid.values or "groundspeed" not in grid.values:
        return torch.zeros_like(grid.time_s)
    wind = grid.values["groundspeed"] - level_part_kt(grid.values) * drift_cosine(grid.values)
    known = wind.isfinite().any(1)
    tailwind = torch.zeros_like(wind)
    if bool(known.any()):
        tailwind[known] = filled(wind[known]) * KT_MPS
    return tailwind


def corrected_entries(compared: Compared, added: AddedEffects) -> Tensor:
    """Entries (n, p) of both sides once the simulator has the effects.

    Args:
        compared: Flights of both sides.
        added: What is put in.
    """
    simulated = torch.nonzero(~compared.real)[:, 0]
    left = compared.y.clone()
    if not len(simulated) or not added.theta:
        return left
    state = _before(compared, simulated)
    flown, reported = added.changes(state)
    moved = dict(flown)
    moved["cas"] = flown["cas"] + reported["cas"]
    # The rate of a comparison is beyond the polar's at the speed that the flight reports.
    faster = log_rate(state, faster_mps=moved["cas"] * KT_MPS) - state.own_log_rate
    moved["rate"] = flown["rate"] + reported["rate"] - faster
    moved["tas"] = flown["tas"] + reported["tas"]
    moved["lag"], moved["mismatch"] = reported["rate"], reported["cas"]
    for name in ("wind", "height"):
        moved[name] = state.centred(flown[name] + reported[name])
    moved |= {name: value for name, value in reported.items() if name not in moved}
    for i, entry in enumerate(compared.entries):
        if entry.quantity in moved:
            change = moved[entry.quantity]
            left[simulated, i] += change[:, entry.band] if entry.band >= 0 else change
    return left


def _before(compared: Compared, simulated: Tensor) -> FlightState:
    """The simulator's flights as effects are put into them, each at its own rate."""
    state = compared.state.rows_of_fleet(simulated)
    return replace(state, affected=False, beyond_polar=compared.table("rate", compared.y[simulated]).nan_to_num(0.0))
