r"""Difference of the means of two sides, and how surely it is known.

With :math:`\bar y_r, \bar y_s` the means by entry (a quantity in a band, gaps left out) of real and simulated flights,

.. math:: d = \bar y_r - \bar y_s, \qquad
   V = \mathrm{LW}\Big(\sum_a u_a u_a^\top\Big) + \mathrm{diag}(\nu^2) + E, \qquad
   u_a = \pm\sum_{f \in a} \frac{y_f - \bar y}{n},

summed over the aircraft :math:`a` of both sides. The air of a day is that of all its flights: where the means of days
differ more than those of separate aircraft would, the error is as much larger. Each side has a spread of its
own, so weather, masses and crews that differ between real flights and not between simulated ones need no term. Where
physics takes the simulator's place, it claims zero. Correlations are shrunk by the weight of Ledoit and Wolf (2004,
Journal of Multivariate Analysis 88). :math:`\nu` is the negligible shift of each entry. :math:`E` holds what all
flights of a side share: one error of rounding where they hardly differ, half of what a wider spread of speeds does
to the mean CAS, which is the lower of two schedules, and what the simulator's coefficients leave open of the rate at
speeds that its own flights do not fly.
"""

from dataclasses import dataclass

import numpy as np
import torch
from scipy.stats import norm
from scipy.stats import t as student_t

from descentflow.core.linear_gaussian import Array, shrunk
from descentflow.core.units import KT_MPS
from descentflow.diagnosis.sides.simulator_coefficients import scaled
from descentflow.diagnosis.sides.two_sides import Compared
from descentflow.effects.flight_state import Schedule, log_rate

FEWEST_AIRCRAFT = 20
"""Aircraft of a side from which their spread is known well enough for a normal law."""


@dataclass(frozen=True)
class Moments:
    """Moments of what is compared, p entries.

    Attributes:
        difference: (p,) mean of the real flights minus that of the simulator's.
        covariance: (p, p) of its error.
        departures: (n, p) of each flight from its side's mean, NaN where not seen.
        negligible: (p,) shift of a mean that means nothing in practice.
        quantity: (p,) name.
        kernel: (p, p) correlation of what is smooth in altitude, zero between quantities.
        shrunk_off: (p, p) part of the covariance that shrinking its correlations takes off.
    """

    difference: Array
    covariance: Array
    departures: Array
    negligible: Array
    quantity: np.ndarray
    kernel: Array
    shrunk_off: Array | float = 0.0


def moments(compared: Compared) -> Moments:
    """Take the moments of both sides.

    Args:
        compared: Flights of both sides, with a simulator's flights among them.
    """
    assumed = compared.assumed
    y, real, airframe = compared.y.numpy(), compared.real.numpy(), compared.airframe.numpy()
    day = compared.day.numpy()
    quantity = np.array([entry.quantity for entry in compared.entries])
    kernel = smooth_kernel(compared, quantity, assumed.length_m)
    bend = spread_of_speeds(compared, quantity)
    negligible = compared.negligible().numpy()
    open_rate = left_open_by_coefficients(compared, quantity)
    error = np.diag(negligible**2) + np.outer(bend, bend) / 4.0 + open_rate @ open_rate.T
    step = np.array([assumed.rounding.get(name, 0.0) for name in quantity])
    difference, departures, sums = -bend, np.full_like(y, np.nan), []
    for side, sign in ((real, 1.0), (~real, -1.0)) if compared.has_simulated else ((real, 1.0),):
        mean = np.nanmean(y[side], 0)
        difference = difference + sign * mean
        departures[side] = y[side] - mean
        sums.append(sums_by_aircraft_and_day(departures[side], airframe[side], day[side], quantity, kernel))
        # Flights that differ by less than the step of a field share one error of rounding, which no mean takes away;
        # at speeds that differ each is rounded otherwise.
        variance, of_speed = np.nanvar(y[side], 0), quantity == "cas"
        alike = max(1.0 - float((variance[of_speed] / step[of_speed] ** 2).mean()), 0.0) if of_speed.any() else 1.0
        shared = np.sqrt(alike * np.maximum(step**2 - variance, 0.0))
        error = error + np.outer(shared, shared) * (kernel + np.eye(len(kernel))) / 2.0
    # What few aircraft do not show of how levels go together is smooth, and does not average out.
    rows, of_flight = np.concatenate(sums), compared.of_flight().numpy()
    apart = of_flight[:, None] != of_flight
    covariance = np.where(apart, 0.0, shrunk(rows, kernel if compared.short_of_causes else 0.0))
    shrunk_off = np.where(apart, 0.0, rows.T @ rows) - covariance
    return Moments(difference, covariance + error, departures, negligible, quantity, kernel, shrunk_off)


def smooth_kernel(compared: Compared, quantity: np.ndarray, length_m: float) -> Array:
    """Squared-exponential correlation (p, p) over altitude within a quantity."""
    levels = compared.state.altitude_m.numpy()
    altitude = np.array([levels[entry.band] if entry.band >= 0 else 0.0 for entry in compared.entries])
    apart = (altitude[:, None] - altitude) / length_m
    return np.where(quantity[:, None] == quantity, np.exp(-0.5 * apart**2), 0.0)


def sums_by_aircraft_and_day(
    departures: Array, airframe: np.ndarray, day: np.ndarray, quantity: np.ndarray, kernel: Array
) -> Array:
    """Contributions (c, p) of aircraft and of days to the error of a side's mean.

    Their squares sum to the variance by aircraft, times how much more the means of days differ than those of separate
    aircraft would. That ratio is of a whole quantity, and as wide as Student's t of so few days.

    Example:
        >>> apart, names = np.array([[1.0], [1.1], [-1.0], [-1.1]]), np.array(["rate"])
        >>> rows = sums_by_aircraft_and_day(apart, np.arange(4), np.array([1, 1, 2, 2]), names, np.eye(1))
        >>> bool((rows**2).sum() > 10 * (sums_over(apart, np.arange(4)) ** 2).sum())  # two days, one degree of freedom
        True
    """
    by_aircraft, by_day = sums_over(departures, airframe), sums_over(departures, day)
    own, of_days = (by_aircraft**2).sum(0), (by_day**2).sum(0)
    wanted = own * few_wider(len(by_aircraft))
    for name in dict.fromkeys(quantity):
        mine = quantity == name
        smooth = kernel[np.ix_(mine, mine)]
        freedom = (len(by_day) - 1) * np.trace(smooth) ** 2 / (smooth**2).sum()
        if freedom > 0.0 and own[mine].sum() > 0.0:
            wider = (student_t.ppf(0.975, freedom) / norm.ppf(0.975)) ** 2
            wanted[mine] *= max(1.0, wider * of_days[mine].sum() / own[mine].sum())
    sums: Array = np.concatenate([by_aircraft, by_day]) * np.sqrt(wanted / np.maximum(own + of_days, 1e-300))
    return sums


def few_wider(count: int) -> float:
    """Factor of a variance that fewer than twenty aircraft give: Student's t in place of the normal law.

    Example:
        >>> [round(few_wider(count), 2) for count in (5, 10, 20)]
        [2.01, 1.33, 1.0]
    """
    return float((student_t.ppf(0.975, max(count - 1, 1)) / norm.ppf(0.975)) ** 2) if count < FEWEST_AIRCRAFT else 1.0


def sums_over(departures: Array, group: np.ndarray) -> Array:
    """Contribution of each group (c, p) to the error of its side's mean, scaled so that squares are unbiased.

    Example:
        >>> sums_over(np.array([[1.0], [1.0], [-2.0]]), np.array([7, 7, 9])).round(2)
        array([[ 0.94],
               [-0.94]])
    """
    count = np.maximum(np.isfinite(departures).sum(0), 1)
    _, index = np.unique(group, return_inverse=True)
    groups = int(index.max()) + 1
    total = np.zeros((groups, departures.shape[1]))
    np.add.at(total, index, np.nan_to_num(departures) / count)
    sums: Array = total * np.sqrt(groups / max(groups - 1, 1))
    return sums


FLIGHTS_OF_COEFFICIENTS = 40
"""Flights by whose mean the part of the coefficients is known well enough."""


def left_open_by_coefficients(compared: Compared, quantity: np.ndarray) -> Array:
    """Change (p, d) of the difference by one standard deviation of each independent part of the coefficients.

    Rates are beyond the polar's at each flight's own speed. A simulator of one speed shows little of how drag follows
    it: as far as both sides' speeds differ, so far does the polar's rate at them stay open.
    """
    directions = np.zeros((len(quantity), 0))
    if not compared.has_simulated:
        return directions
    bands = torch.tensor([entry.band for entry in compared.entries])
    of_rate = torch.from_numpy(quantity == "rate")
    for direction in compared.coefficients.directions().T:
        apart = torch.zeros(len(quantity), dtype=torch.float64)
        for side, sign in ((compared.real, 1.0), (~compared.real, -1.0)):
            rows = torch.nonzero(side)[:, 0]
            state = compared.state.rows_of_fleet(rows[:: max(len(rows) // FLIGHTS_OF_COEFFICIENTS, 1)])
            moved = (log_rate(scaled(state, direction)) - log_rate(scaled(state, -direction))) / 2.0
            mean = torch.where(state.mask, moved, 0.0).sum(0) / state.mask.sum(0).clamp(min=1)
            apart += sign * torch.where(of_rate, mean[bands], 0.0)
        directions = np.concatenate([directions, apart.numpy()[:, None]], 1)
    return directions


def spread_of_speeds(compared: Compared, quantity: np.ndarray) -> Array:
    """Difference (p,) of the mean CAS, kt, that a wider spread of schedules makes at equal means of them.

    CAS is the lower of a schedule's CAS and of that of its Mach number: its mean is not that of the mean schedule.
    """
    if not compared.has_simulated:
        return np.zeros(len(quantity))
    state, plan = compared.state, compared.state.schedule
    sides = []
    for side in (~compared.real, compared.real):
        weight = state.mask[side].double()
        weight = weight / weight.sum(0).clamp(min=1.0)
        own = Schedule(plan.mach[side], plan.cas_mps[side])
        sides.append((own, weight, (own.mach * weight).sum(0), (own.cas_mps * weight).sum(0)))
    simulated = sides[0]
    means = []
    for own, weight, mach, cas in sides:
        at_equal_means = own.at(state.altitude_m, simulated[2] - mach, simulated[3] - cas)
        means.append((at_equal_means * weight).sum(0))
    bend = ((means[1] - means[0]) / KT_MPS).numpy()
    return np.array(
        [bend[e.band] if name == "cas" else 0.0 for e, name in zip(compared.entries, quantity, strict=True)]
    )
