"""Comparison of both sides: entries that can be compared, and what the simulator claims of each."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import torch
from torch import Tensor

from descentflow.core.errors import DataError
from descentflow.diagnosis.sides.assumptions import ASSUMED, Assumptions
from descentflow.diagnosis.sides.compared_state import (
    KNOWN_SHARE,
    by_own_air,
    by_own_turns,
    report_delay_s,
    state_of,
    turned_more,
)
from descentflow.diagnosis.sides.simulator_coefficients import SimulatorCoefficients, simulator_coefficients
from descentflow.diagnosis.sides.vectors import Entry, Vectors
from descentflow.effects.flight_state import FlightState, log_rate
from descentflow.measurements.quantities import Quantities
from descentflow.measurements.quantity_registry import BY_BAND, OF_FLIGHT
from descentflow.physics.performance_model import PerformanceModel

CLAIMED_ZERO = ("rate", "lag", "mismatch", "tas", "wind", "height")
"""Quantities that are zero by physics, whether or not the simulator's own flights measured them."""
MIN_FLIGHTS_SHOWING, FEWEST_SHOWING = 10, 5
MIN_SHARE_SHOWING = 0.1
"""An entry is compared if so many, and this share, of the flights of either side show it; of fewer than twenty flights
half, and five."""
FEWEST_FOR_CAUSES = 20
"""Flights of a side from which all effects are sought: hundreds tell them apart."""
MIN_AIRCRAFT_APART = 7
"""Fewest aircraft that differ from the usual value of a quantity which most flights show alike (time level, noise).
With fewer, such a quantity is not compared: m aircraft are all of one side by chance in 1 of 2^(m - 1) cases, and at
most 2 % is allowed."""


@dataclass(frozen=True)
class Compared(Vectors):
    """Flights of both sides as vectors, and the state of each flight that effects look at.

    Example:
        >>> from descentflow.aircraft_types.registry import aircraft
        >>> from descentflow.measurements.quantities import CHANNELS, quantities_of
        >>> from descentflow.surveillance.descents.prepared_descents import read_descents
        >>> flights = quantities_of(read_descents("descents.parquet").frame, 150, 340, CHANNELS)
        >>> nominal = compare(None, flights, aircraft("A320"))
        >>> nominal.has_simulated, len(nominal.state.cas_mps)
        (False, 120)
    """

    state: FlightState
    coefficients: SimulatorCoefficients = field(default_factory=SimulatorCoefficients.unknown)
    """Of the aircraft that the simulator flies, as far as known; ``state`` is taken with them."""
    own_air: Tensor | float = 0.0
    """(n, K) change of ln rate by the air that each flight measured, NaN where it did not; zero where too few did."""
    measures_air: bool = False
    """True if both sides measured their air, so that ``own_air`` is whole; else it is that beyond the side's mean."""

    @property
    def short_of_causes(self) -> int:
        """Number of flights that a side lacks for causes that rest on coefficients, or on single flights."""
        sides = [self.real, ~self.real] if self.has_simulated else [self.real]
        return max(FEWEST_FOR_CAUSES - min(int(side.sum()) for side in sides), 0)

    def in_own_air(self) -> "Compared":
        """The same flights, their rates without what the air does that each met; bands that too few then show go."""
        columns, shown = self.of("rate"), []
        y, taken = self.y.clone(), self.own_air + torch.zeros_like(self.state.cas_mps)
        for i in self.columns("rate").tolist():
            y[:, i] = y[:, i] - taken[:, self.entries[i].band]
        for i, is_rate in enumerate(columns.tolist()):
            sides = [y[self.real, i], *([y[~self.real, i]] if self.has_simulated else [])]
            if not is_rate or all(_enough(side) for side in sides):
                shown.append(i)
        state = replace(self.state, own_air=taken.nan_to_num(0.0))
        return replace(self, y=y, scale=_spread(y, self.real), state=state).only(torch.tensor(shown, dtype=torch.long))


def compare(
    simulated_flights: Quantities | None, real: Quantities, aircraft: PerformanceModel, assumed: Assumptions = ASSUMED
) -> Compared:
    """Join both sides.

    Args:
        simulated_flights: The simulator's; None where it claims the polar's rate at the reference mass.
        real: Real flights, on the same bands.
        aircraft: Coefficients of the simulator.
        assumed: Constants.

    Raises:
        DataError: If no quantity is shown by enough flights of each side in one band.

    Example:
        >>> from descentflow.aircraft_types.registry import aircraft
        >>> from descentflow.measurements.quantities import CHANNELS, quantities_of
        >>> from descentflow.surveillance.descents.prepared_descents import read_descents
        >>> flights = quantities_of(read_descents("descents.parquet").frame, 150, 340, CHANNELS)
        >>> first = flights.airframe % 2 == 0
        >>> compare(flights.rows(first), flights.rows(~first), aircraft("A320")).quantities()[:4]
        ('rate', 'lag', 'cas', 'mismatch')
    """
    both = _joined(simulated_flights, real) if simulated_flights else real
    is_real = torch.arange(len(both)) >= len(both) - len(real)
    settled = both.physics["depth_m"] >= assumed.settled_m
    rate, lag = (torch.where(settled, x, torch.nan) for x in (both.physics["log_rate"], both.values["lag"]))
    coefficients, mass_kg = SimulatorCoefficients.unknown(assumed), float(aircraft.mass_reference_kg)
    state = state_of(both, aircraft, mass_kg, assumed)
    if simulated_flights:
        # Air that its flights met is none of its coefficients.
        freed, _ = _own_air(state, both, is_real)
        own = state_of(simulated_flights, aircraft, mass_kg, assumed)
        shown = (rate - freed.nan_to_num(0.0))[~is_real]
        coefficients = simulator_coefficients(own, shown, simulated_flights.airframe, assumed)
    state = coefficients.applied(state)
    state, expected = _with_turns(state, both.physics.get("turning"), is_real)
    values = {**both.values, "rate": rate - expected, "lag": lag}
    columns = _columns(values, is_real, both.airframe, assumed)
    if not columns:
        raise DataError(
            f"no quantity that enough of {len(real)} real flights show in one band",
            expected=f"at least {FEWEST_SHOWING} flights on both sides through the same levels",
            mend="give more flights",
        )
    y = torch.stack(list(columns.values()), 1)
    own_air, measures_air = _own_air(state, both, is_real)
    flights = (is_real, _spread(y, is_real), both.airframe, both.known_day, state.altitude_m, real.band_fl)
    seen = (_with_usual(state, values, is_real), coefficients, own_air, measures_air)
    return Compared(tuple(columns), y, *flights, *seen, names=real.names, assumed=assumed)


def _own_air(state: FlightState, both: Quantities, real: Tensor) -> tuple[Tensor, bool]:
    """Change (n, K) of ln rate by the air that flights measured, and whether both sides measured theirs.

    Where one side did not, its air is not known, and no mean of the other may change by air: what is beyond it goes.
    """
    unknown = torch.full_like(state.cas_mps, torch.nan)
    slope, warmth = both.physics.get("air_slope_per_s", unknown), both.values.get("tas", unknown)
    sides = [side for side in (real, ~real) if bool(side.any())]
    warmth, change = warmth.clone(), torch.zeros_like(unknown)
    for side in sides:
        warmth[side] = torch.where(warmth[side].isfinite(), warmth[side], warmth[side].nanmean(0))
    by_air, shown = by_own_air(state, slope, warmth), both.physics["log_rate"].isfinite()
    knows = [bool((by_air[side].isfinite() & shown[side]).sum() > KNOWN_SHARE * shown[side].sum()) for side in sides]
    for side, known in zip(sides, knows, strict=True):
        if known:
            change[side] = by_air[side] if all(knows) else by_air[side] - by_air[side].nanmean(0)
    return change, all(knows)


def _with_turns(state: FlightState, turning: Tensor | None, real: Tensor) -> tuple[FlightState, Tensor]:
    """State, and ln of the polar's rate (n, K), with each flight's own turns where those of real flights are known."""
    expected = log_rate(state)
    if turning is None or not bool(turning[real].isfinite().any()):
        return state, expected
    state = replace(state, turned_more=turned_more(turning, real))
    return state, expected + by_own_turns(state, turning, real)


def _with_usual(state: FlightState, values: Mapping[str, Tensor], real: Tensor) -> FlightState:
    """State with the mean change of real flights' rate, and what the simulator's add to the polar and report late."""
    assert state.rate_change_per_s is not None
    usual = state.rate_change_per_s[real].nanmean(0).nan_to_num(0.0)
    state = replace(state, usual_rate_change_per_s=usual)
    if bool(real.all()):
        return state
    beyond = values["rate"][~real].nanmean(0).nan_to_num(0.0)
    delay = report_delay_s(state.rows(torch.nonzero(~real)[:, 0]), values["lag"][~real])
    return replace(state, beyond_polar=beyond, report_delay_s=delay)


def _columns(values: Mapping[str, Tensor], real: Tensor, airframe: Tensor, assumed: Assumptions) -> dict[Entry, Tensor]:
    """Entries that can be compared, each with its values (n,)."""
    columns = {}
    for name in (name for name in (*BY_BAND, *OF_FLIGHT) if name in values):
        for band, column in enumerate(values[name].unbind(1)) if name in BY_BAND else [(-1, values[name])]:
            compared = _compared(name, column, real, assumed)
            if compared is not None and not _tells_nothing(column, airframe):
                columns[Entry(name, band)] = compared
    return columns


def _compared(name: str, column: Tensor, real: Tensor, assumed: Assumptions) -> Tensor | None:
    """Values (n,) of both sides without extremes; None where too few flights show any."""
    shown, simulated = column[real], column[~real]
    anchored = _enough(simulated)
    # Physics claims zero only where no flight of the simulator shows a value; a few are too few to compare.
    claimed = name in CLAIMED_ZERO and not bool(simulated.isfinite().any())
    if not _enough(shown) or not (anchored or claimed):
        return None
    sides = [shown, simulated] if anchored else [shown]
    shown, *known = _drawn_in(sides, assumed.extreme, assumed.negligible_shift(name))
    # Where the simulator's flights measured nothing, flights of mean zero with the real spread are its claim.
    stand_in = torch.arange(len(simulated)) % len(shown)
    return torch.cat([known[0] if anchored else (shown - shown.nanmean())[stand_in], shown])


def _tells_nothing(column: Tensor, airframe: Tensor) -> bool:
    """Test for a quantity that is the same in most flights, and differs in a few aircraft."""
    apart = (column - column.nanmedian()).abs() > 1e-9  # nothing that is missing
    alike = int(column.isfinite().sum()) > 2 * int(apart.sum())
    return alike and len(torch.unique(airframe[apart])) < MIN_AIRCRAFT_APART


def _enough(column: Tensor) -> bool:
    count = int(column.isfinite().sum())
    least = min(MIN_FLIGHTS_SHOWING, max(len(column) // 2, FEWEST_SHOWING))
    return count >= max(least, MIN_SHARE_SHOWING * len(column))


def _drawn_in(sides: Sequence[Tensor], extreme: float, least: float) -> list[Tensor]:
    """Values of sides without the extremes of each, by the spread of the wider one, which is at least so much.

    One spread for both, for nothing but their values may tell them apart where there is no gap; and at least what is
    negligible, for where half of the flights show the least noise that there is, the robust spread is nearly nothing.
    """
    middles = [column.nanmedian() for column in sides]
    away = [(column - middle).abs().nanmedian() for column, middle in zip(sides, middles, strict=True)]
    spread = 1.4826 * max(float(one.nan_to_num(0.0)) for one in away)
    if spread < 1e-9:
        return list(sides)
    most = extreme * max(spread, least)
    return [
        torch.where(column.isfinite(), column.clamp(float(middle) - most, float(middle) + most), column)
        for column, middle in zip(sides, middles, strict=True)
    ]


def _spread(y: Tensor, real: Tensor) -> Tensor:
    """Standard deviation (p,) between flights of one side, pooled over both."""
    seen = y.isfinite()
    total, count = torch.zeros(y.shape[1], dtype=y.dtype), torch.zeros(y.shape[1], dtype=y.dtype)
    for side in (real, ~real):
        part, there = y[side].nan_to_num(0.0), seen[side]
        n = there.sum(0).clamp(min=1)
        total += (part.square().sum(0) - part.sum(0) ** 2 / n).clamp(min=0.0)
        count += (n - 1).clamp(min=0)
    return (total / count.clamp(min=1)).sqrt().clamp(min=1e-9)


def _joined(first: Quantities, second: Quantities) -> Quantities:
    def cat(a: dict[str, Tensor], b: dict[str, Tensor]) -> dict[str, Tensor]:
        both = {}
        for name in {**a, **b}:
            like = a[name] if name in a else b[name]
            blank = [torch.full((len(q), *like.shape[1:]), torch.nan, dtype=like.dtype) for q in (first, second)]
            both[name] = torch.cat([a.get(name, blank[0]), b.get(name, blank[1])])
        return both

    airframe = torch.cat([first.airframe, second.airframe + first.airframe.max() + 1])
    day = torch.cat([first.known_day, second.known_day])
    values, physics = cat(first.values, second.values), cat(first.physics, second.physics)
    return Quantities(second.levels_fl, second.band_fl, values, physics, airframe, day=day)
