r"""Rates of single flights about the mean of their side, without what the air around each explains.

Rates are by altitude over time: the reported rate minus how late it is, so that no late report passes for brakes. An
aircraft trades height for the speed over ground that wind and temperature take from it, so a flight's rate moves with
its own air, level by level,

.. math:: g_1\,\frac{\partial \ln R}{\partial w'}\, w'_f + g_2\,\frac{\partial \ln R}{\partial w'}\,
   (V \tau_f)' + g_3\,\frac{\partial \ln R}{\partial \Delta T}\,\Delta T_f,

with the slope of the wind :math:`w'`, of the true airspeed by the air's temperature :math:`(V\tau)'`, and the
temperature itself. Each side has its own gains g by least squares, between 0 and 1: air that is measured with noise
explains less. Temperature is by TAS and Mach number, or by the slope of the geometric height.
"""

from dataclasses import dataclass

import numpy as np

from descentflow.diagnosis.evidence.moments import Moments
from descentflow.diagnosis.inference.linear_gaussian import Array
from descentflow.diagnosis.inference.two_sides import Compared
from descentflow.effects.flight_state import FlightState, log_rate
from descentflow.physics.airspeed import mach_to_tas_mps
from descentflow.physics.atmosphere import isa_temperature_k

WIND_STEP_PER_S, KELVIN_STEP = 1e-3, 1.0


@dataclass(frozen=True)
class FlightRates:
    """ln of the rate of each flight about the mean of its side.

    Attributes:
        values: (n, m), zero where not seen.
        seen: (n, m).
        entries: (m,) positions among what is compared.
        bands: (m,).

    Example:
        >>> from descentflow.diagnosis.evidence.assumptions import Assumptions
        >>> from descentflow.diagnosis.evidence.moments import moments
        >>> from descentflow.diagnosis.inference.example_sides import example_sides
        >>> sides = example_sides()
        >>> found = flight_rates(sides, moments(sides, Assumptions()))
        >>> found.values.shape, bool(abs(found.values[sides.real.numpy()].mean(0)).max() < 1e-3)
        ((160, 11), True)
    """

    values: Array
    seen: np.ndarray
    entries: np.ndarray
    bands: np.ndarray


def flight_rates(compared: Compared, known: Moments) -> FlightRates:
    """Take what is flown by each flight, without its own air.

    Args:
        compared: Flights of both sides.
        known: Their moments.
    """
    entries = np.flatnonzero(known.quantity == "rate")
    bands = np.array([compared.entries[i].band for i in entries], dtype=int)
    values = known.departures[:, entries] - np.nan_to_num(_by_band(compared, known, "lag")[:, bands])
    values = values - _by_own_air(compared, known, values, bands)
    seen = np.isfinite(values)
    return FlightRates(np.where(seen, values, 0.0), seen, entries, bands)


def _by_band(compared: Compared, known: Moments, quantity: str) -> Array:
    """Departures (n, K) of a quantity, NaN where it is not seen."""
    found = np.full((len(known.departures), len(compared.state.altitude_m)), np.nan)
    for i, entry in enumerate(compared.entries):
        if entry.quantity == quantity:
            found[:, entry.band] = known.departures[:, i]
    return found


def _by_own_air(compared: Compared, known: Moments, values: Array, bands: np.ndarray) -> Array:
    """Change (n, m) of each flight's rate by its own air."""
    state, altitude = compared.state, compared.state.altitude_m
    tas = _by_band(compared, known, "tas")
    # Half of ln of the temperature's ratio, which is ln of that of the true airspeed.
    warmth = np.where(np.isfinite(tas), tas, _slope(_by_band(compared, known, "height"), altitude.numpy()) / 2.0)
    speed = mach_to_tas_mps(state.mach(), altitude, 0.0).numpy()
    by_wind, by_kelvin = _sensitivities(state)
    kelvin = 2.0 * isa_temperature_k(altitude).numpy() * warmth
    wind = _slope(_by_band(compared, known, "wind"), altitude.numpy())
    columns = np.stack([by_wind * wind, by_wind * _slope(speed * warmth, altitude.numpy()), by_kelvin * kelvin], 2)
    columns = np.nan_to_num(columns[:, bands])
    found = np.zeros_like(values)
    real = compared.real.numpy()
    for side in (real, ~real):
        seen = np.isfinite(values) & side[:, None]
        gains = np.linalg.lstsq(columns[seen], values[seen], rcond=None)[0]
        found[side] = columns[side] @ np.clip(gains, 0.0, 1.0)
    return found


def _sensitivities(state: FlightState) -> tuple[Array, Array]:
    """Derivatives of ln R by the slope of the wind (1/s) and by the temperature (K): means (K,) over the flights."""
    weight = state.mask.double()
    weight = weight / weight.sum(0).clamp(min=1.0)
    wind = [log_rate(state, wind_slope_per_s=sign * WIND_STEP_PER_S) for sign in (1, -1)]
    warm = [log_rate(state, deviation_k=sign * KELVIN_STEP) for sign in (1, -1)]
    steps = ((wind, WIND_STEP_PER_S), (warm, KELVIN_STEP))
    first, second = (((up - down) * weight).sum(0).numpy() / (2.0 * step) for (up, down), step in steps)
    return first, second


def _slope(values: Array, altitude_m: Array) -> Array:
    """Slope over altitude (n, K), of the bands on both sides or of the one there is."""
    step = np.diff(values, axis=1) / np.diff(altitude_m)
    blank = np.full((len(values), 1), np.nan)
    up, down = np.concatenate([step, blank], 1), np.concatenate([blank, step], 1)
    return np.where(np.isfinite(up) & np.isfinite(down), (up + down) / 2.0, np.where(np.isfinite(up), up, down))
