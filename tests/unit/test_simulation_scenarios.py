"""Scenarios: the structure that the paper describes shows in the rows, and nothing else changes."""

from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
import pytest
import torch
from sklearn.mixture import GaussianMixture

from descentflow.aircraft_types.open_types.open_aircraft import open_aircraft
from descentflow.core.errors import ConfigError
from descentflow.simulation.parameters import PARTS, draw_parameters
from descentflow.simulation.scenarios import scenario_settings
from descentflow.simulation.world import World, simulate
from descentflow.simulation.world_config import WorldConfig
from descentflow.surveillance.rows.air_data import isa_tas_of_mach_kt
from studies.paper.study_plan import PAPER_FLIGHTS

LONDON = "london-fir-2019"
CALM = {
    "speed_change_share": 0.0,
    "thrust_share": 0.0,
    "brakes_share": 0.0,
    "shear_spread_per_s": 0.0,
    "layer_spread_k": 0.0,
    "daily_spread_k": 0.0,
    "jet_mps": (0.0, 0.0),
    "wander_kt": 1.0,
}
"""Without what hides a structure from a test of a few flights; test_simulation_day_to_day.py has that."""


def fly(typecode: str, n: int = 60, **changes: Any) -> World:
    aircraft = open_aircraft(typecode)
    quick: dict[str, Any] = {
        "level_off_share": 0.0,
        "managed_share": 0.0,
        "gap_share": 0.0,
        "step_s": 2.0,
        "interval_s": 2,
    }
    return simulate(aircraft, n, 0, replace(scenario_settings(LONDON, aircraft), **{**quick, **CALM, **changes}))


def cas_at(world: World, level_fl: float) -> np.ndarray:
    """IAS of each flight's first report below a level."""
    below = world.rows.filter(pl.col("altitude") < 100 * level_fl)
    return below.group_by("flight_id", maintain_order=True).first()["IAS"].to_numpy()


def bic(values: np.ndarray, clusters: int) -> tuple[float, np.ndarray]:
    fitted = GaussianMixture(clusters, random_state=0, n_init=3).fit(values[:, None])
    spread = np.sqrt(fitted.covariances_[:, 0, 0].mean())
    return fitted.bic(values[:, None]), np.ptp(fitted.means_) / spread


def test_cas_has_two_modes_where_there_are_two_operators_and_one_where_there_is_one() -> None:
    """Modes further apart than two standard deviations (Ashman's D) and preferred by BIC; for the BE20 one suffices."""
    two, one = (cas_at(fly(c, 300, slow_start_share=0.0, two_rates_share=0.0), 200) for c in ("B738", "BE20"))
    assert bic(two, 2)[0] < bic(two, 1)[0] - 10
    assert bic(two, 2)[1] > 2 * 2**0.5
    assert bic(one, 1)[0] < bic(one, 2)[0]


def test_turboprops_hold_one_rate_and_then_a_steeper_one() -> None:
    world = fly("DH8D", 40, two_rates_share=1.0)
    planned = world.rows.join(world.flights.select("flight_id", "top_fl", "^(first|second)_.*$"), on="flight_id")
    level = pl.col("altitude") / 100
    margin = 12  # flight levels in which a rate is taken up
    first = planned.filter(level.is_between(pl.col("first_low_fl") + 2, pl.col("top_fl") - margin))
    second = planned.filter(level.is_between(150, pl.min_horizontal("first_low_fl", "top_fl") - margin))
    for stretch, name in ((first, "first"), (second, "second")):
        held = stretch.group_by("flight_id").agg(
            rate=pl.col("vertical_rate").mean(), scatter=pl.col("vertical_rate").std(), n=pl.len()
        )
        held = held.filter(pl.col("n") >= 10).join(world.flights, on="flight_id")
        assert len(held) > 15
        assert (held["rate"] - held[f"{name}_rate_fpm"]).abs().max() < 40
        assert held["scatter"].median() < 60
    rates = world.flights
    assert (rates["second_rate_fpm"] < rates["first_rate_fpm"]).all()
    assert ((rates["first_rate_fpm"] % 100).is_between(29.9, 70.1)).all()


def test_slow_starts_are_slow_and_then_idle() -> None:
    world = fly("B738", 40, slow_start_share=1.0)
    labels = world.truth.join(world.flights.select("flight_id", "first_low_fl"), on="flight_id")
    above = labels.filter(pl.col("altitude_m") / 30.48 > pl.col("first_low_fl") + 1)
    below = labels.filter(pl.col("altitude_m") / 30.48 < pl.col("first_low_fl") - 30)
    assert "idle" not in above["label"].cast(str).unique().to_list()
    assert (below["label"] == "idle").mean() > 0.7
    steep = [part.filter(pl.col("label") != "transient")["rate_mps"].median() for part in (above, below)]
    assert steep[1] < 1.5 * steep[0] < 0


def test_a_business_jets_cas_has_its_knee_near_fl300() -> None:
    """A straight line in CAS above, a constant below; the two lines meet within ten levels of FL300."""
    world = fly("F2TH")
    knees = []
    for flight in world.rows.partition_by("flight_id"):
        level, cas = flight["altitude"].to_numpy() / 100, flight["IAS"].to_numpy()
        upper, lower = (level > 310) & (level < flight["altitude"].max() / 100 - 15), level < 280
        if upper.sum() < 20:
            continue
        slope, offset = np.polyfit(level[upper], cas[upper], 1)
        assert slope < -0.4
        assert abs(np.polyfit(level[lower], cas[lower], 1)[0]) < 0.05
        knees.append((cas[lower].mean() - offset) / slope)
    assert len(knees) > 20
    assert abs(np.median(knees) - 300) < 5
    assert np.std(knees) < 10


def test_constant_rates_change_no_other_draw() -> None:
    aircraft = open_aircraft("DH8D")
    config = scenario_settings(LONDON, aircraft)
    plain, segments = (
        draw_parameters(aircraft, range(20), 3, c) for c in (replace(config, two_rates_share=0.0), config)
    )
    assert not plain.constant_rates.rate_mps.numel()
    assert segments.constant_rates.rate_mps.numel()
    for field in fields(plain):
        if field.name not in PARTS:
            torch.testing.assert_close(getattr(plain, field.name), getattr(segments, field.name), equal_nan=True)
    for part in ("weather", "speed_changes", "off_idle"):
        for name, value in vars(getattr(plain, part)).items():
            torch.testing.assert_close(value, getattr(getattr(segments, part), name))
    few = draw_parameters(aircraft, range(5, 9), 3, config)
    torch.testing.assert_close(
        few.constant_rates.rate_mps, segments.constant_rates.rate_mps[5:9], rtol=0, atol=0, equal_nan=True
    )


def test_every_type_of_the_paper_has_its_settings_and_plain_is_the_default() -> None:
    for typecode in PAPER_FLIGHTS:
        aircraft = open_aircraft(typecode)
        config = scenario_settings(LONDON, aircraft)
        assert config.operators
        assert all(o.cas_kt < float(aircraft.vmo_kt) and o.mach < float(aircraft.mmo) for o in config.operators)
        assert scenario_settings("plain", aircraft) == WorldConfig()


def test_scenarios_that_cannot_be_are_refused(tmp_path: Path) -> None:
    aircraft = open_aircraft("A320")
    with pytest.raises(ConfigError, match="no scenario nowhere"):
        scenario_settings("nowhere", aircraft)
    with pytest.raises(ConfigError, match="A20N"):
        scenario_settings(LONDON, open_aircraft("A20N"))
    for text, complaint in (
        ("[A320", "not TOML"),
        ("[A320]\nspeed = 3", "speed"),
        ('[A320]\noperators = [{name = "X", share = 1, cas_kt = 280}]', "mach"),
        ("[A320]\ntops_fl = 3", "ranges of two"),
        ("[A320]\ncas_spread_kt = -1", "cas_spread_kt"),
    ):
        path = tmp_path / "own.toml"
        path.write_text(text)
        with pytest.raises(ConfigError, match=complaint):
            scenario_settings(str(path), aircraft)


@pytest.mark.parametrize("scenario", ["gulf-summer", "nordic-winter"])
def test_worlds_to_judge_on_have_every_type_and_operators_of_their_own(scenario: str) -> None:
    for typecode in PAPER_FLIGHTS:
        aircraft = open_aircraft(typecode)
        mine, london = (scenario_settings(name, aircraft) for name in (scenario, LONDON))
        assert mine.operators
        assert london.operators
        assert not {(o.cas_kt, o.mach) for o in mine.operators} & {(o.cas_kt, o.mach) for o in london.operators}
        assert all(o.mach < aircraft.mmo and o.cas_kt < aircraft.vmo_kt for o in mine.operators)
        assert mine.deviation_mean_k != london.deviation_mean_k


def test_the_gulf_is_warmer_than_the_north_in_what_aircraft_report() -> None:
    """TAS over that of the Mach number in standard air: some 22 K between the two."""
    ratio, aircraft = [], open_aircraft("A320")
    for scenario in ("gulf-summer", "nordic-winter"):
        high = replace(scenario_settings(scenario, aircraft), bottom_fl=200.0, low_top_share=0.0, step_s=2.0)
        rows = simulate(aircraft, 10, 0, high).rows
        ratio.append(
            float((rows["TAS"] / isa_tas_of_mach_kt(rows["Mach"].to_numpy(), rows["altitude"].to_numpy())).mean())
        )
    # Of 240 K, the square of the ratio; days differ by 5 K in the north, of which ten flights meet few.
    assert 240 * (ratio[0] ** 2 - ratio[1] ** 2) == pytest.approx(22, abs=12)
