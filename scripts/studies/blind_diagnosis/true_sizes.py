"""Planted sizes in the units in which a diagnosis reports them, where the two mean the same thing.

Where flights differ, it is the mean of what the flights of the set have got, which is drawn again from their seed: that
takes no flying.
"""

import math
from collections.abc import Callable, Mapping
from typing import Final

import torch
from torch import Tensor

from descentflow.aircraft_types.registry import aircraft as find_aircraft
from descentflow.core.constants import T0_K
from descentflow.core.units import FL_M, KT_MPS
from descentflow.physics.atmosphere import isa_temperature_k
from descentflow.simulation.causes import Injection
from descentflow.simulation.causes.air_and_instruments import KT_PER_KFT
from descentflow.simulation.injected import REFERENCE_MACH
from descentflow.simulation.parameters import draw_parameters
from studies.blind_diagnosis.blind_plan import SetPlan
from studies.blind_diagnosis.blind_worlds import foreign_scenario, own_scenario
from studies.jsbsim_world.airframes import AIRFRAMES
from studies.jsbsim_world.flight_plans import FlightPlan, draw_plans
from studies.jsbsim_world.model_effects import inject

Own = Mapping[str, Tensor]
"""Values of a cause by flight; NaN for those without."""
_BIAS_MACH: Final = 0.65
"""Mach number at which a diagnosis states the constant part of a bias."""
_LEVELS_FL: Final = (150.0, 350.0)
"""Levels over which a deviation that is not the same at all of them is averaged."""


def _relative(own: Own) -> dict[str, float]:
    # A diagnosis reports the mean over all flights, those without included.
    return {"relative_change": float((own["factor"] - 1).nan_to_num().mean())}


def _brake(own: Own) -> dict[str, float]:
    low, high = (float(own[f"{end}_fl"].nanmean()) for end in ("low", "high"))
    extra, share = float((own["factor"] - 1).nan_to_num().mean()), float(own["factor"].isfinite().double().mean())
    return {"extra_cd0": extra, "low_fl": low, "high_fl": high, "share": share}


def _bias(own: Own) -> dict[str, float]:
    slope = float(own["slope_kt_per_mach"].mean())
    return {"bias_kt": float(own["bias_kt"].mean()) + slope * (_BIAS_MACH - REFERENCE_MACH), "growth_kt": 0.1 * slope}


def _mean_of_all(own: Own, *names: str) -> dict[str, float]:
    return {name: float(own[name].nan_to_num().mean()) for name in names}


REPORTED: dict[str, Callable[[Own], dict[str, float]]] = {
    "temperature": lambda own: _mean_of_all(own, "deviation_k"),
    "wind_gradient": lambda own: {"slope_per_s": KT_PER_KFT * float(own["slope_kt_per_kft"].mean())},
    "mass": _relative,
    "idle_thrust": _relative,
    "drag_polar": _relative,
    "speed_brake": _brake,
    "speed_schedule": lambda own: _mean_of_all(own, "cas_kt", "mach"),
    "airspeed_bias": _bias,
    "vertical_rate_lag": lambda own: _mean_of_all(own, "lag_s"),
}
"""By cause; held paths and rates and level-offs are missing, for their sizes are shares of flights that hold them,
and a diagnosis reports what cleaning leaves of them."""
OTHER_BASE: Final = ("extra_cd0",)
"""Of JSBSim's aircraft, what cannot be compared: drag (and thrust) is relative to the model's own, and a diagnosis
states it relative to the aircraft whose coefficients it was given."""


def reported(cause: str, own: Own) -> dict[str, float]:
    """Sizes that a diagnosis should report for a planted cause; empty where they are not comparable.

    Args:
        cause: Its name.
        own: What each flight has got of it.

    Example:
        >>> reported("mass", {"factor": torch.tensor([0.9, 0.8, torch.nan])})  # the third flight is as it was
        {'relative_change': -0.1...}
    """
    return REPORTED[cause](own) if cause in REPORTED else {}


def true_sizes(plan: SetPlan) -> dict[str, dict[str, float]]:
    """Sizes that a diagnosis of a set should report, by cause.

    Args:
        plan: The set.

    Example:
        >>> causes = {"mass": {"factor": 0.9}}
        >>> one = SetPlan("blind_0", "blind", "single", causes, 1.0, "all", 9, "simulator_0", 1, "own", "A320")
        >>> true_sizes(one)
        {'mass': {'relative_change': -0.0999...}}
    """
    if not plan.causes:
        return {}
    if plan.world == "own":
        own = _own_flights(plan)
        return {name: reported(name, values) for name, values in own.items()}
    sizes_of = {name: reported(name, values) for name, values in _foreign_flights(plan).items()}
    return {name: {k: size for k, size in sizes.items() if k not in OTHER_BASE} for name, sizes in sizes_of.items()}


def _own_flights(plan: SetPlan) -> dict[str, Own]:
    """Values in the flights of a set of our own world, by cause and value."""
    aircraft = find_aircraft(plan.model)
    flights = Injection(aircraft, plan.causes, plan.seed)(
        draw_parameters(aircraft, range(plan.flights), plan.seed, own_scenario("flights", plan.model))
    )
    return {
        name: {key.removeprefix(f"{name}_"): own for key, own in flights.planted.items() if key.startswith(f"{name}_")}
        for name in plan.causes
    }


def _foreign_flights(plan: SetPlan) -> dict[str, Own]:
    """The same of JSBSim's flights, by what each cause changes in their plans."""
    airframe, config = AIRFRAMES[plan.model], foreign_scenario("flights", plan.model)
    before = draw_plans(airframe, range(plan.flights), plan.seed, config)
    owns: dict[str, Own] = {}
    for name in plan.causes:
        if name in _OF_PLANS:
            after = inject(airframe, before, {name: plan.causes[name]}, plan.seed, config.flights_per_aircraft)
            own = [_OF_PLANS[name](a, b) for a, b in zip(after, before, strict=True)]
            owns[name] = {key: torch.tensor([o[key] for o in own], dtype=torch.float64) for key in own[0]}
    return owns


def _share_at_pressure_altitudes() -> float:
    """Share of a deviation at geometric heights that is left, mean over levels of pressure.

    By hydrostatics the air at a pressure altitude then is warmer by the share dT / T0 of its standard temperature.
    """
    levels = torch.linspace(*_LEVELS_FL, 41, dtype=torch.float64) * FL_M
    return float(isa_temperature_k(levels).mean()) / T0_K


_OF_PLANS: dict[str, Callable[[FlightPlan, FlightPlan], dict[str, float]]] = {
    "temperature": lambda a, b: {"deviation_k": _share_at_pressure_altitudes() * (a.deviation_k - b.deviation_k)},
    "wind_gradient": lambda a, b: {"slope_kt_per_kft": (a.wind_slope_per_s - b.wind_slope_per_s) / KT_PER_KFT},
    "mass": lambda a, b: {"factor": a.mass_kg / b.mass_kg},
    "speed_brake": lambda a, b: {
        "factor": 1 + a.brake if a.brake else math.nan,
        "low_fl": a.brake_low_m / FL_M,
        "high_fl": a.brake_high_m / FL_M,
    },
    "speed_schedule": lambda a, b: {"cas_kt": (a.cas_mps - b.cas_mps) / KT_MPS, "mach": a.mach - b.mach},
    "airspeed_bias": lambda a, b: {
        "bias_kt": a.cas_bias_mps / KT_MPS,
        "slope_kt_per_mach": a.cas_bias_slope_mps / KT_MPS,
    },
    "vertical_rate_lag": lambda a, b: {"lag_s": a.rate_lag_s},
    "measurement_noise": lambda a, b: {"factor": a.noise_factor},
}
"""Value of a cause in a flight, by its plan after and before."""
