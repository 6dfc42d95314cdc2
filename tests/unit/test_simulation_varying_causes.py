"""Causes that differ between flights: each law by goodness of fit, without flying; each fails by chance 1 in 1,000."""

import numpy as np
import pytest
from scipy import stats

from descentflow.aircraft_types.open_types.open_aircraft import open_aircraft
from descentflow.core.units import FL_M
from descentflow.simulation.causes import Injection
from descentflow.simulation.parameters import FlightParameters, draw_parameters
from descentflow.simulation.world_config import WorldConfig

A320 = open_aircraft("A320")
N = 600
CHANCE = 1e-3


def drawn(seed: int = 2, flights_per_aircraft: int = 5, **causes: dict[str, float]) -> FlightParameters:
    config = WorldConfig(low_top_share=0.0, flights_per_aircraft=flights_per_aircraft)
    return Injection(A320, causes, seed)(draw_parameters(A320, range(N), seed, config))


def fits(values: np.ndarray, law: str, *numbers: float) -> bool:
    return bool(stats.kstest(values, law, args=numbers).pvalue > CHANCE)


def share_fits(flags: np.ndarray, share: float) -> bool:
    return bool(stats.binomtest(int(flags.sum()), len(flags), share).pvalue > CHANCE)


@pytest.mark.parametrize(
    ("cause", "mean", "spread", "value", "low", "high"),
    [
        ("temperature", {"deviation_k": 8.0}, {"spread_k": 3.0}, "deviation_k", 8.0, 3.0),
        ("wind_gradient", {"slope_kt_per_kft": -1.0}, {"spread_kt_per_kft": 0.4}, "slope_kt_per_kft", -1.0, 0.4),
        ("mass", {"factor": 0.95}, {"spread": 0.05}, "factor", 0.95, 0.05),
        ("drag_polar", {"factor": 1.05}, {"spread": 0.03}, "factor", 1.05, 0.03),
    ],
)
def test_a_spread_is_normal(
    cause: str, mean: dict[str, float], spread: dict[str, float], value: str, low: float, high: float
) -> None:
    own = drawn(**{cause: mean | spread}).planted[f"{cause}_{value}"].numpy()
    assert fits(own, "norm", low, high)
    assert set(drawn(**{cause: mean}).planted[f"{cause}_{value}"].tolist()) == {low}


def test_brakes_have_levels_heights_and_drag_of_each_flights_own() -> None:
    values = {"factor": 1.5, "share": 0.6, "low_fl": 220.0, "high_fl": 270.0, "spread_fl": 15.0}
    p = drawn(speed_brake={**values, "depth_spread": 0.2, "strength_spread": 0.1})
    low, high, factor = (p.planted[f"speed_brake_{name}"].numpy() for name in ("low_fl", "high_fl", "factor"))
    taken = np.isfinite(low)
    assert share_fits(taken, 0.6)
    assert fits((low + high)[taken] / 2, "norm", 245, 15)
    assert fits((high - low)[taken], "norm", 50, 10)
    assert fits(factor[taken], "norm", 1.5, 0.05)
    assert p.injected is not None
    np.testing.assert_allclose(p.injected.brake_high_m.numpy()[taken], high[taken] * FL_M)
    assert not p.injected.brake_gain.numpy()[~taken].any()
    # No flight's window says anything of its drag.
    assert abs(stats.spearmanr((low + high)[taken], factor[taken]).statistic) < 0.18


def test_paths_and_rates_are_each_flights_own() -> None:
    p = drawn(geometric_path={"share": 1.0, "of_idle": 0.88, "of_idle_range": 0.08})
    alike = drawn(geometric_path={"share": 1.0, "of_idle": 1.0}).planted["geometric_path_angle_deg"].numpy()
    own = p.planted["geometric_path_angle_deg"].numpy()
    # Both rounded to the shallower tenth of a degree, so their ratio is blurred by a thirtieth.
    assert abs(np.mean(own / alike) - 0.88) < 0.02
    assert np.std(own / alike) == pytest.approx(0.16 / 12**0.5, rel=0.35)
    assert np.abs(own * 10 - np.round(own * 10)).max() < 1e-9
    held = drawn(vertical_speed_mode={"share": 1.0, "depth_fl": 80.0, "depth_range_fl": 30.0, "of_idle_range": 0.1})
    height = held.planted["vertical_speed_mode_high_fl"] - held.planted["vertical_speed_mode_low_fl"]
    room = (held.top_m - held.bottom_m).numpy() / FL_M > 80 + 30 + 50
    assert fits(height.numpy()[room], "uniform", 50, 60)
    rates = held.planted["vertical_speed_mode_rate_fpm"].numpy()
    assert len(np.unique(np.round(rates / 100))) > 5


def test_days_and_airframes_share_what_is_theirs() -> None:
    """Twenty days: deviations alike within a day, and by the spread between days."""
    p = drawn(flights_per_aircraft=20, temperature={"deviation_k": 0.0, "daily_spread_k": 4.0})
    own, day = p.planted["temperature_deviation_k"].numpy(), p.day.numpy()
    by_day = np.array([np.unique(own[day == k]) for k in range(20)])
    assert by_day.shape == (20, 1)
    assert fits(by_day[:, 0], "norm", 0.0, 4.0)
    p = drawn(vertical_rate_lag={"lag_s": 20.0, "spread_s": 3.0}, airspeed_bias={"bias_kt": 1.0, "spread_kt": 0.5})
    for name, mean, spread in (("vertical_rate_lag_lag_s", 20.0, 3.0), ("airspeed_bias_bias_kt", 1.0, 0.5)):
        own = p.planted[name].numpy().reshape(-1, 5)
        assert (own == own[:, :1]).all()
        assert fits(own[:, 0], "norm", mean, spread)


def test_a_share_of_the_flights_and_none_of_the_others() -> None:
    plain = drawn()
    heavy = drawn(mass={"factor": 1.2, "share": 0.3})
    taken = heavy.planted["mass_factor"].isfinite()
    assert share_fits(taken.numpy(), 0.3)
    np.testing.assert_allclose((heavy.mass_kg / plain.mass_kg).numpy(), np.where(taken, 1.2, 1.0))
    kept = drawn(kept_thrust={"share": 0.3, "share_range": 0.1, "decay_range_s": 50.0, "of_flights": 0.7})
    share, decay = (kept.planted[f"kept_thrust_{name}"].numpy() for name in ("share", "decay_s"))
    assert share_fits(np.isfinite(share), 0.7)
    assert fits(share[np.isfinite(share)], "uniform", 0.2, 0.2)
    assert fits(decay[np.isfinite(decay)], "uniform", 100, 100)
    powered = drawn(powered_descent={"share": 0.18, "share_range": 0.06, "of_flights": 1.0}).planted
    assert fits(powered["powered_descent_share"].numpy(), "uniform", 0.12, 0.12)
    slow = drawn(speed_schedule={"cas_kt": -15.0, "mach": -0.01, "spread_kt": 2.0, "share": 0.8})
    cas = slow.planted["speed_schedule_cas_kt"].numpy()
    assert share_fits(np.isfinite(cas), 0.8)
    assert fits(cas[np.isfinite(cas)], "norm", -15, 2)


def test_a_path_is_planned_for_the_speeds_and_forces_that_the_flight_meets() -> None:
    """Causes act in one order: less drag makes the idle path shallower, and the held one with it."""
    path = {"share": 1.0, "of_idle": 0.9}
    plain = drawn(geometric_path=path).planted["geometric_path_angle_deg"]
    for name, values in (("induced_drag", {"factor": 0.8}), ("speed_schedule", {"cas_kt": -40.0, "mach": -0.05})):
        changed = drawn(geometric_path=path, **{name: values}).planted["geometric_path_angle_deg"]
        assert float((changed - plain).mean()) > 0.02, name
