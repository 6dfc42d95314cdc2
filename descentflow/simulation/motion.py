"""The full equation of motion of a point mass in time: nothing here knows of an energy share factor.

``m dV/dt = Thr - D - m g sin(gamma) - m dw/dt cos(gamma)``, ``dh/dt = V sin(gamma)`` in geometric altitude, and
``dHp/dt = dh/dt T_isa / T`` because pressure falls with the air's own density. Lift equals weight in the drag, as in
BADA, and the mass is constant: an idle descent burns 0.3 % of it.
"""

from dataclasses import dataclass

import torch
from torch import Tensor

from descentflow.core.constants import G0_MPS2
from descentflow.physics.airspeed import tas_to_mach
from descentflow.physics.atmosphere import isa_fraction
from descentflow.physics.performance_model import PerformanceModel
from descentflow.simulation.parameters import FlightParameters


@dataclass(frozen=True)
class Motion:
    """State of the flights: true airspeed (m/s), pressure altitude (m), geometric altitude (m), each of shape (n,).

    Example:
        >>> one = torch.ones(1)
        >>> cruise, sinking = Motion(230 * one, 10_000 * one, 10_000 * one), Motion(0 * one, -10 * one, -10 * one)
        >>> cruise.moved(sinking, time_s=60.0).altitude_m
        tensor([9400.])
    """

    tas_mps: Tensor
    altitude_m: Tensor
    height_m: Tensor

    def moved(self, rate: "Motion", time_s: float) -> "Motion":
        """Return the state after a time at a constant rate of change."""
        return Motion(
            torch.add(self.tas_mps, rate.tas_mps, alpha=time_s),
            torch.add(self.altitude_m, rate.altitude_m, alpha=time_s),
            torch.add(self.height_m, rate.height_m, alpha=time_s),
        )


@dataclass(frozen=True)
class Controls:
    """Commands of the autopilot for one period, (n,): path angle (rad), thrust above idle (N), their rates (per s).

    Example:
        >>> none = torch.zeros(2)
        >>> spooling_up = Controls(gamma=none, gamma_rate=none, extra_n=none, extra_rate=none + 500.0)
        >>> spooling_up.extra_n + 4.0 * spooling_up.extra_rate  # thrust above idle after 4 s
        tensor([2000., 2000.])
    """

    gamma: Tensor
    gamma_rate: Tensor
    extra_n: Tensor
    extra_rate: Tensor


class Dynamics:
    """The aircraft of a batch of flights, with their own drag, thrust, mass, air and wind.

    Args:
        aircraft: Coefficients of the type.
        parameters: The flights.

    Example:
        >>> from descentflow.aircraft_types.open_types.open_aircraft import open_aircraft
        >>> from descentflow.simulation.parameters import draw_parameters
        >>> aircraft = open_aircraft("A320")
        >>> dynamics = Dynamics(aircraft, draw_parameters(aircraft, [0], seed=0))
        >>> one = torch.ones(1, dtype=torch.float64)
        >>> cruise, level = Motion(230 * one, 10_000 * one, 10_000 * one), 0 * one
        >>> slower = dynamics.step(cruise, Controls(level, level, level, level), time_s=1.0)  # level at idle thrust
        >>> float(slower.tas_mps - cruise.tas_mps) < 0
        True
    """

    def __init__(self, aircraft: PerformanceModel, parameters: FlightParameters) -> None:
        # Tensors, for every step would make them of numbers again.
        one = torch.ones(1, dtype=torch.float64)
        self.aircraft = aircraft.with_factors(parasitic=parameters.cd0_factor, induced=one, idle=one)
        self.parameters = parameters
        more = parameters.injected
        self._is_clean = not torch.stack([more.brake_gain, more.wave_gain, more.bank_rad, more.induced_gain]).any()
        self._known: tuple[Motion, Tensor, Tensor] | None = None
        self._known_deviation: tuple[Tensor, Tensor] | None = None

    def forces_n(self, state: Motion) -> tuple[Tensor, Tensor]:
        """Drag and idle thrust; asked again where the flights still are, the same: each period begins with both."""
        if self._known is None or self._known[0] is not state:
            self._known = (state, self._drag_n(state), self._idle_n(state))
        return self._known[1:]

    def drag_n(self, state: Motion) -> Tensor:
        """Drag in clean configuration, and what injected brakes, compressibility and banks add."""
        return self.forces_n(state)[0]

    def idle_n(self, state: Motion) -> Tensor:
        """Idle thrust."""
        return self.forces_n(state)[1]

    def _drag_n(self, state: Motion) -> Tensor:
        p = self.parameters
        where = state.tas_mps, state.altitude_m, self.deviation_k(state.altitude_m)
        clean = self.aircraft
        if p.off_idle.brake_gain.numel():
            clean = clean.with_factors(parasitic=p.off_idle.drag_gain(state.altitude_m))
        if self._is_clean:
            return clean.drag_n(*where, p.mass_kg)
        gain = p.injected.drag_gain(state.altitude_m, tas_to_mach(*where))
        load_factor = 1 / torch.cos(p.injected.bank(state.altitude_m))
        induced = 1 + p.injected.induced_gain
        return clean.with_factors(parasitic=gain, induced=induced).drag_n(*where, p.mass_kg, load_factor=load_factor)

    def _idle_n(self, state: Motion) -> Tensor:
        p = self.parameters
        deviation = self.deviation_k(state.altitude_m)
        return p.thrust_factor * self.aircraft.idle_thrust_n(state.altitude_m, state.tas_mps, deviation)

    def wind_mps(self, state: Motion) -> Tensor:
        """Tailwind."""
        p = self.parameters
        return p.wind_mps + p.wind_slope_per_s * state.height_m + p.weather.wind_mps(state.height_m)

    def wind_slope_per_s(self, state: Motion) -> Tensor:
        """Growth of the tailwind with geometric altitude."""
        return self.parameters.wind_slope_per_s + self.parameters.weather.wind_slope_per_s(state.height_m)

    def deviation_k(self, altitude_m: Tensor) -> Tensor:
        """Deviation of the temperature from the standard atmosphere at pressure altitudes (n,).

        Asked again at the same altitudes, the same: drag, thrust and the rate of each step take it.
        """
        p = self.parameters
        if self._known_deviation is None or self._known_deviation[0] is not altitude_m:
            self._known_deviation = (altitude_m, p.deviation_k + p.weather.deviation_k(altitude_m))
        return self._known_deviation[1]

    def rates(self, state: Motion, gamma: Tensor, extra_n: Tensor) -> Motion:
        """Time derivative of the state.

        Args:
            state: Where the flights are.
            gamma: Flight path angle through the air, radians.
            extra_n: Thrust above idle.

        Returns:
            Acceleration, rate of pressure altitude and of geometric altitude.
        """
        p = self.parameters
        sine = torch.sin(gamma)
        height_rate = state.tas_mps * sine
        drag, idle = self.forces_n(state)
        thrust = idle + extra_n
        wind_rate = self.wind_slope_per_s(state) * height_rate * torch.cos(gamma)
        acceleration = (thrust - drag) / p.mass_kg - G0_MPS2 * sine - wind_rate
        fraction = isa_fraction(state.altitude_m, self.deviation_k(state.altitude_m))
        return Motion(acceleration, height_rate * fraction, height_rate)

    def step(self, state: Motion, controls: Controls, time_s: float, substeps: int = 1) -> Motion:
        """Fly one autopilot period by the classical fourth-order Runge-Kutta method.

        Args:
            state: Where the flights are.
            controls: Set by the autopilot; path angle and extra thrust change linearly within the period.
            time_s: Length of the period.
            substeps: Steps within it.

        Returns:
            The state at its end.
        """
        h = time_s / substeps
        for k in range(substeps):
            start, middle, end = k * h, (k + 0.5) * h, (k + 1) * h
            k1 = self._rates_at(state, controls, start)
            k2 = self._rates_at(state.moved(k1, h / 2), controls, middle)
            k3 = self._rates_at(state.moved(k2, h / 2), controls, middle)
            k4 = self._rates_at(state.moved(k3, h), controls, end)
            state = state.moved(k1, h / 6).moved(k2, h / 3).moved(k3, h / 3).moved(k4, h / 6)
        return state

    def _rates_at(self, state: Motion, c: Controls, time_s: float) -> Motion:
        return self.rates(
            state,
            torch.add(c.gamma, c.gamma_rate, alpha=time_s),
            torch.add(c.extra_n, c.extra_rate, alpha=time_s),
        )
