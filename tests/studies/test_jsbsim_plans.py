"""Parts of the JSBSim flights that need no JSBSim: plans, effects, and the scalar atmosphere."""

import math

import pytest
import torch
from scipy import stats

from descentflow.core.errors import ConfigError
from descentflow.core.units import FL_M
from descentflow.physics import airspeed, atmosphere
from studies.jsbsim_world import scalar_air
from studies.jsbsim_world.airframes import AIRFRAMES
from studies.jsbsim_world.flight_plans import JsbsimConfig, draw_plans
from studies.jsbsim_world.model_effects import inject

MD11 = AIRFRAMES["MD11"]


def test_the_scalar_atmosphere_is_the_packages() -> None:
    altitude = torch.linspace(0, 14_000, 57, dtype=torch.float64)
    pressure = atmosphere.pressure_pa(altitude)
    scalar = [scalar_air.pressure_altitude_m(p) for p in pressure.tolist()]
    torch.testing.assert_close(torch.tensor(scalar, dtype=torch.float64), altitude, rtol=0, atol=1e-6)
    temperatures = [scalar_air.isa_temperature_k(h) for h in altitude.tolist()]
    torch.testing.assert_close(torch.tensor(temperatures, dtype=torch.float64), atmosphere.isa_temperature_k(altitude))
    machs = [scalar_air.mach_of_cas(145.0, p) for p in pressure.tolist()]
    expected = airspeed.cas_to_mach(torch.full_like(altitude, 145.0), altitude)
    torch.testing.assert_close(torch.tensor(machs, dtype=torch.float64), expected, rtol=1e-6, atol=0)


def test_each_flight_differs_by_the_law_that_is_planted() -> None:
    """Goodness of fit; each fails by chance once in a thousand."""
    plans = draw_plans(MD11, range(300), 0, JsbsimConfig())

    def fits(values: list[float], law: str, *numbers: float) -> bool:
        return bool(stats.kstest(values, law, args=numbers).pvalue > 1e-3)

    warm = inject(MD11, plans, {"temperature": {"deviation_k": 6.0, "spread_k": 2.0}}, seed=0)
    assert fits([p.deviation_k for p in warm], "norm", 6, 2)
    heavy = inject(MD11, plans, {"mass": {"factor": 1.05, "spread": 0.03}}, seed=0)
    assert fits([p.mass_kg / q.mass_kg for p, q in zip(heavy, plans, strict=True)], "norm", 1.05, 0.03)
    paths = inject(MD11, plans, {"geometric_path": {"share": 1.0, "of_idle": 0.9, "of_idle_range": 0.08}}, seed=0)
    assert fits([p.hold_of_idle for p in paths], "uniform", 0.82, 0.16)
    brakes = {"factor": 1.4, "share": 1.0, "depth_spread": 0.2, "strength_spread": 0.1}
    braked = inject(MD11, plans, {"speed_brake": brakes}, seed=0)
    assert fits([p.brake for p in braked], "norm", 0.4, 0.04)
    assert fits([(p.brake_high_m - p.brake_low_m) / FL_M for p in braked], "norm", 50, 10)
    days = inject(MD11, plans, {"wind_gradient": {"slope_kt_per_kft": 0.0, "daily_spread_kt_per_kft": 1.0}}, seed=0)
    assert all(len({p.wind_slope_per_s for p in days[k::5]}) == 1 for k in range(5))
    late = inject(MD11, plans, {"vertical_rate_lag": {"lag_s": 20.0, "spread_s": 3.0}}, seed=0)
    assert fits([p.rate_lag_s for p in late[::5]], "norm", 20, 3)
    assert all(late[k].rate_lag_s == late[k + 4].rate_lag_s for k in range(0, 300, 5))


@pytest.mark.parametrize(
    ("effects", "message"),
    [
        ({"gremlins": {}}, "one of temperature, wind_gradient"),
        ({"mass": {"weight": 1.1}}, "mass with weight"),
        ({"mass": {"factor": 1.1, "share": 2.0}}, "mass with share=2"),
        ({"mass": {"factor": math.nan}}, "finite"),
        ({"speed_brake": {"factor": 3.0, "share": 1.0, "low_fl": 230, "high_fl": 280}}, "a factor from 1 to 2.00"),
    ],
)
def test_effects_that_cannot_be_are_refused(effects: dict[str, dict[str, float]], message: str) -> None:
    with pytest.raises(ConfigError, match=message):
        inject(MD11, draw_plans(MD11, range(1), 0, JsbsimConfig()), effects, seed=0)
