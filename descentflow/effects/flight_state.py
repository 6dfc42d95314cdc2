"""The rate that the performance equations give a flight at its own speed, and how it answers to a changed cause."""

from dataclasses import dataclass, replace
from functools import cached_property

import torch
from torch import Tensor

from descentflow.core.recent import Recent
from descentflow.core.tensors import Number, as_tensors
from descentflow.physics.airspeed import mach_to_cas_mps, mach_to_tas_mps
from descentflow.physics.energy import ShareTerms, descent_rate_mps
from descentflow.physics.performance_model import PerformanceModel
from descentflow.surveillance.cleaning.thresholds import Cleaning

CLEANING = Cleaning()
"""Default settings, for flights of unknown cleaning."""

SLOWEST_MPS = 0.5
"""Rates are kept this fast before their logarithm is taken: drag that falls to the thrust is no descent."""

CHANGING = 0.3
"""Slopes of CAS between this share of that at constant Mach number and one minus it belong to neither phase."""
NEAR_MACH = 0.02
"""Bands at constant Mach number are within so much of the fastest; slower ones only look like it."""
PARTS = 12
"""Parts of the flights whose state is kept: folds and sides are asked for again in every fit."""
MIN_SHOWN = 10
"""Flights that show their Mach number, for the line that gives it to others."""


@dataclass(frozen=True)
class FlightState:
    """n flights at K pressure altitudes: all that an effect may look at.

    Shapes: ``altitude_m`` (K,), ``width_m`` () the height of the bands around them, all else (n, K). ``mass_kg``
    is the mass of all.

    Example:
        >>> from descentflow.effects._example_flights import example_flights
        >>> state = example_flights()
        >>> state.cas_mps.shape, bool((state.mach().amax(1) < 0.79).all())
        (torch.Size([6, 11]), True)
    """

    aircraft: PerformanceModel
    mass_kg: float
    altitude_m: Tensor
    width_m: float
    cas_mps: Tensor
    cas_slope_per_s: Tensor
    """dCAS/dHp."""
    tailwind_mps: Tensor
    mask: Tensor
    depth_m: Tensor
    """Below the flight's own highest level."""
    affected: bool = True
    """True if the effect is in these flights already (real ones), false if it is to be added (a simulator's)."""
    rate_change_per_s: Tensor | None = None
    """Change of the reported rate over a band, upwards, over the rate and the seconds in the band; NaN where not seen.

    None where no flight was seen."""
    usual_rate_change_per_s: Tensor | None = None
    """(K,) mean of ``rate_change_per_s`` over the real flights; None where it is not known."""
    cleaning: Cleaning = CLEANING
    """Settings by which the flights were cleaned: they say where descents begin."""
    report_delay_s: float = 0.0
    """Delay of reported rates in these flights without the effect; zero where rates are not reported."""
    beyond_polar: Tensor | float = 0.0
    """(K,) or (n, K): ln of the rate that the simulator's flights have beyond the polar's."""
    own_air: Tensor | float = 0.0
    """(n, K) change of ln rate of an idle descent by the air that each flight met, where it is off what is compared."""
    turned_more: Tensor | None = None
    """(K,) share by which turns raise the induced drag of the real flights more than that of the simulator's, in the
    mean and as headings imply; None where unknown."""

    def rows(self, index: Tensor) -> "FlightState":
        """The flights at these positions; the same ones for the same positions, so that what they know is kept."""
        return self._parts.get(tuple(index.tolist()), lambda: self._rows(index))

    @cached_property
    def _parts(self) -> Recent["FlightState"]:
        return Recent(PARTS)

    def _rows(self, index: Tensor) -> "FlightState":
        names = ["cas_mps", "cas_slope_per_s", "tailwind_mps", "mask", "depth_m"]
        names += [] if self.rate_change_per_s is None else ["rate_change_per_s"]
        for name in ("beyond_polar", "own_air"):
            values = getattr(self, name)
            names += [name] if isinstance(values, Tensor) and values.dim() == 2 else []
        return replace(self, **{name: getattr(self, name)[index] for name in names})

    def rows_of_fleet(self, index: Tensor) -> "FlightState":
        """The flights at these positions, with the schedules and delays that all flights together say."""
        rows, plan = self._rows(index), self.schedule
        known = {"schedule": Schedule(plan.mach[index], plan.cas_mps[index]), "reported_below_m": self.reported_below_m}
        rows.__dict__.update(known)
        return rows

    def mach(self) -> Tensor:
        """Mach number (n, K) of the CAS."""
        return self.share_terms.mach

    @cached_property
    def share_terms(self) -> ShareTerms:
        """Terms of the energy share factor from the flights' own speeds, in whatever air."""
        return ShareTerms.of(self.cas_mps, self.altitude_m, self.cas_slope_per_s)

    @cached_property
    def still(self) -> tuple[Tensor, Tensor, Tensor]:
        """True airspeed, energy share factor and idle thrust of the flights as they are in standard, still air."""
        return _in_air(self, self.share_terms, 0.0, 0.0)

    @cached_property
    def own_log_rate(self) -> Tensor:
        """:func:`log_rate` of the flights as they are."""
        return log_rate(self)

    @cached_property
    def schedule(self) -> "Schedule":
        """The Mach number and CAS that each flight holds: means over the bands in which it does.

        A flight seen below its crossover alone does not show its Mach number: it has what others of its CAS hold.
        """
        mach = self.mach().detach()
        ratio = self.cas_slope_per_s / constant_mach_slope(mach, self.altitude_m)
        fastest = torch.where(self.mask, mach, 0.0).amax(1, keepdim=True)
        holds_mach = self.mask & (ratio > 1 - CHANGING) & (mach > fastest - NEAR_MACH)
        holds_cas = self.mask & (ratio.abs() < CHANGING)
        swiftest = torch.where(self.mask, self.cas_mps, 0.0).amax(1, keepdim=True)
        cas = _mean_where(holds_cas, self.cas_mps, swiftest)
        held = _mean_where(holds_mach, mach, fastest)
        # Part of a band at constant Mach number is enough to have reached it.
        shows = ((ratio > CHANGING) & self.mask & (mach > fastest - NEAR_MACH)).any(1, keepdim=True)
        usual = _line_through(cas[shows], held[shows], cas) if int(shows.sum()) >= MIN_SHOWN else fastest
        return Schedule(torch.where(shows, held, torch.maximum(fastest, usual)), cas)

    @cached_property
    def schedule_log_rate(self) -> Tensor:
        """Logarithm of the rate (n, K) on the schedule: without the noise of each flight's own CAS slope."""
        return self._on_schedule(self.altitude_m)

    @cached_property
    def schedule_change_per_s(self) -> Tensor:
        """The ``rate_change_per_s`` (n, K) of the schedule, the step at the crossover included."""
        edges = torch.cat([self.altitude_m - self.width_m / 2, self.altitude_m[-1:] + self.width_m / 2])
        return self._on_schedule(edges).diff(dim=1) / self.width_m * self.schedule_log_rate.exp()

    def _on_schedule(self, altitude_m: Tensor) -> Tensor:
        plan = self.schedule
        cas = plan.at(altitude_m)
        slope = torch.where(cas < plan.cas_mps, constant_mach_slope(plan.mach, altitude_m), 0.0)
        return log_rate(replace(self, altitude_m=altitude_m, cas_mps=cas, cas_slope_per_s=slope))

    def centred(self, values: Tensor) -> Tensor:
        """Values (n, K) minus each flight's mean over its observed bands."""
        count = self.mask.sum(1, keepdim=True).clamp(min=1)
        return values - (values * self.mask).sum(1, keepdim=True) / count

    @cached_property
    def reported_below_m(self) -> Tensor:
        """Depth (K,) below a change of the rate at which its report shows it, by the mean rate in each band."""
        seen = self.mask.sum(0).clamp(min=1)
        rate = torch.where(self.mask, self.schedule_log_rate.exp(), 0.0).sum(0) / seen
        return self.report_delay_s * rate

    def share_below(self, altitude_m: Tensor) -> Tensor:
        """Share (E, K) of each band that lies below altitudes (E,); differentiable in them."""
        bottom = self.altitude_m - self.width_m / 2
        return ((altitude_m[:, None] - bottom) / self.width_m).clamp(0.0, 1.0)


def _mean_where(chosen: Tensor, values: Tensor, otherwise: Tensor) -> Tensor:
    """Mean (n, 1) over the chosen bands (n, K), or something else where there is none."""
    count = chosen.sum(1, keepdim=True)
    return torch.where(count > 0, torch.where(chosen, values, 0.0).sum(1, keepdim=True) / count.clamp(min=1), otherwise)


def _line_through(x: Tensor, y: Tensor, at: Tensor) -> Tensor:
    """The least-squares line through points (m,), at other places."""
    centred = x - x.mean()
    slope = (centred * y).sum() / centred.square().sum().clamp(min=1e-12)
    return y.mean() + slope * (at - x.mean())


@dataclass(frozen=True)
class Schedule:
    """Mach number and CAS held, (n, 1) each.

    Example:
        >>> from descentflow.effects._example_flights import example_flights
        >>> plan = example_flights().schedule
        >>> round(float(plan.mach.mean()), 2), round(float(plan.cas_mps.mean()), 1)
        (0.78, 149.2)
    """

    mach: Tensor
    cas_mps: Tensor

    def at(self, altitude_m: Tensor, more_mach: Number = 0.0, more_mps: Number = 0.0) -> Tensor:
        """CAS (n, K) of the schedule, moved: the slower of the two."""
        by_mach = mach_to_cas_mps(self.mach + more_mach, altitude_m)
        return torch.minimum(self.cas_mps + more_mps + 0 * by_mach, by_mach)


def constant_mach_slope(mach: Tensor, altitude_m: Tensor) -> Tensor:
    """dCAS/dHp at constant Mach number, negative.

    Example:
        >>> slope = constant_mach_slope(torch.tensor(0.78).double(), torch.tensor(10_000.0).double())
        >>> round(float(slope), 4)  # m/s of CAS for each metre
        -0.0105
    """
    return (mach_to_cas_mps(mach, altitude_m + 50.0) - mach_to_cas_mps(mach, altitude_m - 50.0)) / 100.0


def log_rate(
    state: FlightState,
    *,
    mass: Number = 1.0,
    thrust: Number = 1.0,
    parasitic: Number = 1.0,
    induced: Number = 1.0,
    deviation_k: Number = 0.0,
    wind_slope_per_s: Number = 0.0,
    faster_mps: Tensor | None = None,
) -> Tensor:
    """Logarithm of the rate of descent (m/s of pressure altitude) on the polar, by the energy equation.

    Args:
        state: The flights.
        mass: Factor of the mass.
        thrust: Factor of idle thrust.
        parasitic: Factor of the drag without lift, broadcasts against (n, K).
        induced: Factor of the drag by lift, likewise.
        deviation_k: Temperature deviation from ISA.
        wind_slope_per_s: Growth of the tailwind with pressure altitude.
        faster_mps: (n, K) change of CAS, which changes the kinetic energy by its slope too; NaN where there is none.

    Returns:
        (n, K).

    Example:
        >>> from descentflow.effects._example_flights import example_flights
        >>> state = example_flights()
        >>> (log_rate(state, mass=0.9) - log_rate(state)).mean()  # a lighter aircraft falls faster
        tensor(0.0..., dtype=torch.float64)
    """
    aircraft, altitude, kg = state.aircraft, state.altitude_m, state.mass_kg * mass
    if faster_mps is None and _is_none(deviation_k) and _is_none(wind_slope_per_s):
        tas, share, idle = state.still
    else:
        terms = state.share_terms if faster_mps is None else _terms_at(state, faster_mps)
        tas, share, idle = _in_air(state, terms, deviation_k, wind_slope_per_s)
    drag = aircraft.with_factors(parasitic=parasitic, induced=induced).drag_n(tas, altitude, deviation_k, kg)
    rate = descent_rate_mps(aircraft, drag, thrust * idle, tas, share, altitude, deviation_k, kg)
    return (-rate).clamp(min=SLOWEST_MPS).log()


def _terms_at(state: FlightState, faster_mps: Tensor) -> ShareTerms:
    """Terms of the energy share factor at another CAS, whose slope differs by that of the change."""
    slope = state.cas_slope_per_s + slope_between(faster_mps, state.altitude_m).nan_to_num(0.0)
    return ShareTerms.of(state.cas_mps + faster_mps.nan_to_num(0.0), state.altitude_m, slope)


def slope_between(values: Tensor, altitude_m: Tensor) -> Tensor:
    """Slope (n, K) of values over altitude (K,), by the neighbours that are known; NaN where neither is.

    Example:
        >>> slope_between(torch.tensor([[0.0, 1.0, 3.0, 5.0]]), torch.tensor([0.0, 1.0, 2.0, 3.0]))
        tensor([[1.0000, 1.5000, 2.0000, 2.0000]])
    """
    steps = values.diff(dim=1) / altitude_m.diff()
    unknown = torch.full_like(values[:, :1], torch.nan)
    return torch.stack([torch.cat([unknown, steps], 1), torch.cat([steps, unknown], 1)]).nanmean(0)


def _is_none(value: Number) -> bool:
    """True where nothing is asked for: no tensor, which may be differentiated."""
    return isinstance(value, float) and value == 0.0


def _in_air(
    state: FlightState, terms: ShareTerms, deviation_k: Number, wind_slope_per_s: Number
) -> tuple[Tensor, Tensor, Tensor]:
    """True airspeed, energy share factor and idle thrust in air of a deviation and a growth of the wind."""
    tas = mach_to_tas_mps(terms.mach, state.altitude_m, deviation_k)
    idle = state.aircraft.idle_thrust_n(state.altitude_m, tas, deviation_k)
    return tas, terms.factor(*as_tensors(wind_slope_per_s, deviation_k)), idle
