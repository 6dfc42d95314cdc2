r"""State of measured flights for effects: their speeds and slopes on bands of altitude, and how they turn.

Each flight turns elsewhere, which is what brakes look like that each flight uses at its own levels. So rates are taken
against the polar with the induced drag of the flight's own turns, beyond the mean of its side:

.. math:: y_i = \ln R_i - \ln \hat R_i - (e_i - \bar e), \qquad
   e_i = \ln \hat R_i(C_{D2}\, n_i^2) - \ln \hat R_i(C_{D2}).

Means stay as they are. By how much the real flights turn more than the simulator's is left to the effect of the
catalogue for it.

The air that a flight met is measured by its own reports: temperature by TAS and Mach number, and what wind and
temperature add to its speed by groundspeed, track and heading. With both in the energy equation,
:math:`a_i = \ln \hat R_i(\Delta T_i, w'_i) - \ln \hat R_i` is the change of its rate that needs no cause.
"""

import torch
from torch import Tensor

from descentflow.core.constants import G0_MPS2
from descentflow.core.units import FL_M, FPM_MPS
from descentflow.diagnosis.sides.assumptions import ASSUMED, Assumptions
from descentflow.effects.flight_state import FlightState, log_rate
from descentflow.measurements.quantities import Quantities
from descentflow.physics.airspeed import mach_to_tas_mps
from descentflow.physics.atmosphere import isa_fraction, isa_temperature_k
from descentflow.physics.performance_model import PerformanceModel


def state_of(
    flights: Quantities, aircraft: PerformanceModel, mass_kg: float, assumed: Assumptions = ASSUMED
) -> FlightState:
    """State for effects; bands without a report have the column's mean speed, and no mask.

    Example:
        >>> from descentflow.aircraft_types.registry import aircraft
        >>> from descentflow.measurements.quantities import CHANNELS, quantities_of
        >>> from descentflow.surveillance.descents.prepared_descents import read_descents
        >>> flights = quantities_of(read_descents("descents.parquet").frame, 150, 340, CHANNELS)
        >>> state_of(flights, aircraft("A320"), 60e3).cas_mps.shape
        torch.Size([120, 13])
    """
    physics = flights.physics
    cas = physics["cas_mps"]
    filled = torch.where(cas.isfinite(), cas, cas.nanmean(0).nan_to_num(140.0))
    return FlightState(
        aircraft,
        mass_kg,
        flights.altitude_m,
        flights.band_fl * FL_M,
        filled,
        physics["cas_slope_per_s"],
        physics["tailwind_mps"],
        physics["log_rate"].isfinite(),
        physics["depth_m"],
        rate_change_per_s=_calibrated_change(flights, assumed.edge_noise),
    )


def report_delay_s(state: FlightState, lag: Tensor) -> float:
    """Delay of reported rates, by their excess over altitude over time where the rate changes.

    A report that is tau seconds late is that of a height tau times the rate above, so the lag quantity is tau times the
    change of the rate over time: a regression through the origin, over all flights and bands, of one on the other.

    Args:
        state: Flights, usually the simulator's.
        lag: (n, K) logarithm of the reported rate over that of altitude over time.

    Returns:
        Seconds; zero where nothing is reported, or where reports are ahead.

    Example:
        >>> from descentflow.aircraft_types.registry import aircraft
        >>> from descentflow.measurements.quantities import CHANNELS, quantities_of
        >>> from descentflow.surveillance.descents.prepared_descents import read_descents
        >>> flights = quantities_of(read_descents("descents.parquet").frame, 150, 340, CHANNELS)
        >>> state = state_of(flights, aircraft("A320"), 60e3)
        >>> 1.0 < report_delay_s(state, flights.values["lag"]) < 3.0  # s: transponders smooth over three
        True
    """
    if state.rate_change_per_s is None:
        return 0.0
    seen = state.rate_change_per_s.isfinite() & lag.isfinite()
    x, y = state.rate_change_per_s[seen], lag[seen]
    size = float(x.square().sum())
    return max(float(x @ y) / size, 0.0) if size > 0 else 0.0


def _calibrated_change(flights: Quantities, edge_noise: float) -> Tensor:
    """Changes of the reported rate (n, K) drawn towards each band's mean by as much as their noise scatters them.

    The seconds in a band are those of its own altitude over time. A lag is the slope of a regression on the changes,
    which noise in them would flatten (regression calibration: Carroll et al., Measurement Error in Nonlinear Models,
    chapter 4).
    """
    log_rate = flights.physics["log_rate"]
    # Samples report no times of their own, and their rate is what they fly.
    late = flights.values.get("lag", torch.zeros_like(log_rate)).nan_to_num(0.0)
    change = flights.physics["rate_slope_per_m"] * (log_rate - late).exp()
    if "noise_rate" not in flights.values:
        # Sampled flights have none, and so nothing is known of it where they are one of the sides.
        return change
    noise_mps = flights.values["noise_rate"].exp()[:, None] * FPM_MPS
    noise = (edge_noise * (noise_mps / (flights.band_fl * FL_M)) ** 2).expand_as(change)
    mean = change.nanmean(0)
    spread = ((change - mean) ** 2).nanmean(0)
    true = (spread - noise.where(change.isfinite(), torch.nan).nanmean(0)).clamp(min=0.0)
    return torch.where(noise.isfinite(), mean + true / (true + noise) * (change - mean), torch.nan)


KNOWN_SHARE = 0.5
"""Of the rates of a side whose flights measured their air, for it to be taken off; the others are then left out."""


def by_own_air(state: FlightState, slope_per_s: Tensor, warmth: Tensor) -> Tensor:
    """Change (n, K) of ln rate by the air that each flight measured, beyond standard calm air; NaN where it did not.

    Args:
        state: The flights.
        slope_per_s: (n, K) growth with altitude of what the air adds to the speed along the heading, NaN where unknown.
        warmth: (n, K) logarithm of the true airspeed over that of the Mach number in standard air; NaN where unknown.

    Example:
        >>> from descentflow.effects._example_flights import example_flights
        >>> state = example_flights()
        >>> none, more = torch.zeros(6, 11).double(), torch.full((6, 11), 0.001).double()
        >>> changed = by_own_air(state, more, none)  # 0.6 kt more tailwind for each 1,000 ft
        >>> torch.allclose(changed, log_rate(state, wind_slope_per_s=more) - log_rate(state))
        True
    """
    deviation_k = isa_temperature_k(state.altitude_m) * ((2 * warmth.nan_to_num(0.0)).exp() - 1)
    # Warm air adds to the speed, the more the faster the flight: that much of the slope is in its own equation already.
    standard, own = (_speed_slope_per_s(state, air) for air in (torch.zeros_like(deviation_k), deviation_k))
    wind_slope = slope_per_s - (own - standard)
    return log_rate(state, deviation_k=deviation_k, wind_slope_per_s=wind_slope) - state.own_log_rate


def _speed_slope_per_s(state: FlightState, deviation_k: Tensor) -> Tensor:
    """Growth dV/dHp (n, K) of the true airspeed with pressure altitude in air of a deviation."""
    share = 1 / state.share_terms.factor(torch.zeros_like(deviation_k), deviation_k) - 1
    tas = mach_to_tas_mps(state.mach(), state.altitude_m, deviation_k)
    return share * G0_MPS2 / tas / isa_fraction(state.altitude_m, deviation_k)


def turned_more(turning: Tensor, real: Tensor) -> Tensor:
    """Share (K,) by which turns raise the induced drag of real flights more than of the simulator's, in the mean.

    A simulator of whose turns nothing is known is taken to fly straight.

    Args:
        turning: (n, K) of each flight, NaN where it is not known.
        real: (n,) which flights are real.

    Example:
        >>> turned_more(torch.tensor([[0.1, torch.nan], [0.3, 0.2]]), torch.tensor([False, True]))
        tensor([0.2000, 0.2000])
    """
    return turning[real].nanmean(0).nan_to_num(0.0) - turning[~real].nanmean(0).nan_to_num(0.0)


def by_own_turns(state: FlightState, turning: Tensor, real: Tensor) -> Tensor:
    """Change (n, K) of ln rate by each flight's own turns beyond the mean of its side; zero where they are not known.

    Args:
        state: The flights.
        turning: (n, K) share by which turns raise their induced drag, NaN where it is not known.
        real: (n,) which flights are real.

    Example:
        >>> from descentflow.effects._example_flights import example_flights
        >>> turning = torch.zeros(6, 11).double()
        >>> turning[3, 5] = 0.3  # one of three real flights turns in one band
        >>> changed = by_own_turns(example_flights(), turning, torch.arange(6) > 2)
        >>> bool(changed[3, 5] > 0.04), bool(changed[4, 5] < 0), bool((changed[:3] == 0).all())
        (True, True, True)
    """
    change = log_rate(state, induced=1 + turning.nan_to_num(0.0)) - state.own_log_rate
    change = torch.where(turning.isfinite(), change, torch.nan)
    for side in (real, ~real):
        change[side] = change[side] - change[side].nanmean(0)
    return change.nan_to_num(0.0)
