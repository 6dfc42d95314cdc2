"""Worlds: what rows and truth hold, and what they may depend on."""

from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import polars as pl
import pytest
from kept_worlds import keep_worlds
from polars.testing import assert_frame_equal
from refusals import refuses
from toys import AIRCRAFT

from descentflow.aircraft_types.open_types.open_aircraft import open_aircraft, open_typecodes
from descentflow.cli.entry import main
from descentflow.core.errors import ConfigError
from descentflow.core.mode_s_steps import STEPS
from descentflow.core.units import FL_M, FPM_MPS, FT_M, KT_MPS
from descentflow.simulation.parameters import draw_parameters
from descentflow.simulation.world import World, simulate
from descentflow.simulation.world_config import WorldConfig, default_operators

N = 150


@pytest.fixture(scope="module")
def world() -> World:
    return simulate(AIRCRAFT, N, seed=4)


def test_times_rise_within_a_flight_and_flights_of_an_aircraft_do_not_overlap(world: World) -> None:
    steps = world.rows.select(pl.col("timestamp").diff().over("flight_id")).to_series().drop_nulls()
    assert steps.min().total_seconds() > 0
    spans = world.rows.group_by("icao24", "flight_id").agg(
        pl.col("timestamp").min().alias("a"), pl.col("timestamp").max().alias("b")
    )
    assert spans.group_by("icao24").len()["len"].unique().to_list() == [5]
    gaps = spans.sort("icao24", "a").select((pl.col("a") - pl.col("b").shift(1)).over("icao24")).to_series()
    assert gaps.drop_nulls().min().total_seconds() > 3600


@pytest.mark.parametrize("field", STEPS)
def test_fields_are_quantised(world: World, field: str) -> None:
    counts = world.rows[field] / STEPS[field]
    assert (counts - counts.round()).abs().max() < 1e-6
    assert counts.n_unique() > 10


def test_noise_is_what_was_asked_for() -> None:
    config = WorldConfig(jitter_s=0.0, dropout_share=0.0, gap_share=0.0, rate_smoothing_s=0.0, step_s=2.0, interval_s=2)
    world = simulate(AIRCRAFT, 60, 0, config)
    both = world.rows.hstack(world.truth.select("altitude_m", "rate_mps", "cas_mps", "mach", "tas_mps"))

    def spread(field: str, truth: str, unit: float) -> float:
        return both.select((pl.col(field) - pl.col(truth) / unit).std()).item()

    # Standard deviation of noise and of rounding (a twelfth of the quantum squared) together; 10,000 rows give 1 %.
    assert spread("vertical_rate", "rate_mps", FPM_MPS) == pytest.approx((40**2 + 32**2 / 12) ** 0.5, rel=0.05)
    assert spread("altitude", "altitude_m", FT_M) == pytest.approx((5**2 + 25**2 / 12) ** 0.5, rel=0.05)
    assert spread("IAS", "cas_mps", KT_MPS) == pytest.approx((0.4**2 + 1 / 12) ** 0.5, rel=0.05)
    assert spread("Mach", "mach", 1.0) == pytest.approx((0.0008**2 + 0.004**2 / 12) ** 0.5, rel=0.05)
    assert spread("TAS", "tas_mps", KT_MPS) == pytest.approx((0.6**2 + 4 / 12) ** 0.5, rel=0.05)


def test_reports_are_lost(world: World) -> None:
    kept = len(world.rows) / len(world.truth)
    assert 0.94 < kept < 0.98  # 3 % one by one, 10 % of flights for some 40 of 800 s
    short = WorldConfig(bottom_fl=250.0, low_top_share=0.0, gap_share=0.0)
    half, every = (simulate(AIRCRAFT, 5, 0, replace(short, dropout_share=share)).rows for share in (0.5, 0.0))
    assert len(half) < 0.6 * len(every)


def test_place_follows_groundspeed(world: World) -> None:
    flight = world.rows.filter(pl.col("flight_id") == "TOY-4-00001")
    north, east = (flight[c].to_numpy() * 3.141592653589793 / 180 * 6371e3 for c in ("latitude", "longitude"))
    from numpy import cos, hypot, radians

    moved = hypot(north[-1] - north[0], (east[-1] - east[0]) * cos(radians(flight["latitude"].mean())))
    seconds = (flight["timestamp"][-1] - flight["timestamp"][0]).total_seconds()
    assert moved / seconds == pytest.approx(flight["groundspeed"].mean() * KT_MPS, rel=0.03)


def test_seed_repeats_and_matters(world: World) -> None:
    again = simulate(AIRCRAFT, N, seed=4)
    for name in ("rows", "flights", "truth"):
        assert_frame_equal(getattr(world, name), getattr(again, name), check_exact=True)
    own, other = (draw_parameters(AIRCRAFT, range(N), seed, WorldConfig()).mass_kg.tolist() for seed in (4, 5))
    assert world.flights["mass_kg"].to_list() == own
    assert other[0] != own[0]


def test_labels_say_what_happens(world: World) -> None:
    truth = world.truth.with_columns(pl.col("rate_mps") / FPM_MPS)

    def of(label: str) -> pl.DataFrame:
        return truth.filter(pl.col("label") == label)

    assert of("idle")["rate_mps"].max() < -500
    assert (of("idle")["thrust_n"] / of("idle")["drag_n"]).max() < 0.5
    assert of("level_off")["rate_mps"].abs().max() < 200
    held = of("constant_rate")
    # At most 100 ft/min from the hundred that was selected, while speed changes under it.
    assert ((held["rate_mps"] / 100 - (held["rate_mps"] / 100).round()) * 100).abs().quantile(0.9) < 20
    spread = held.group_by("flight_id").agg(pl.col("rate_mps").std())["rate_mps"]
    assert spread.max() < 40
    planned = world.flights["level_off_fl"].is_not_null().sum()
    assert 0.06 * N < planned < 0.25 * N
    flown = of("level_off")["flight_id"].n_unique()
    assert flown == planned


def test_level_offs_last_as_planned(world: World) -> None:
    lasted = world.truth.filter(pl.col("label") == "level_off").group_by("flight_id").agg(pl.len() * 4.0)
    both = lasted.join(world.flights, on="flight_id")
    assert both["len"].to_list() == pytest.approx(both["level_off_s"].to_list(), abs=6)
    heights = world.truth.filter(pl.col("label") == "level_off").join(world.flights, on="flight_id")
    assert (heights["altitude_m"] / FL_M - heights["level_off_fl"]).abs().max() < 0.6


def test_flights_start_and_end_where_planned(world: World) -> None:
    ends = world.truth.group_by("flight_id", maintain_order=True).agg(
        pl.col("altitude_m").first().alias("first"), pl.col("altitude_m").last().alias("last")
    )
    assert (ends["first"] / FL_M).to_list() == pytest.approx(world.flights["top_fl"].to_list(), abs=1e-9)
    assert (ends["last"] / FL_M - 90).abs().max() < 1
    tops = world.flights["top_fl"]
    assert tops.max() * 100 <= AIRCRAFT.altitude_maximum_ft
    assert (tops % 10).abs().max() < 1e-9
    assert tops.n_unique() >= 10


def test_cas_has_a_mode_for_each_operator() -> None:
    world = simulate(AIRCRAFT, 300, 0, WorldConfig(step_s=2.0, interval_s=2))
    low = world.rows.filter(pl.col("altitude").is_between(14500, 15500))
    cas = low.group_by("flight_id").agg(pl.col("IAS").mean()).join(world.flights, on="flight_id")
    operators = {o.name: o for o in default_operators(AIRCRAFT)}
    assert cas["operator"].n_unique() == 3
    for (name,), group in cas.group_by("operator"):
        assert group["IAS"].mean() == pytest.approx(operators[name].cas_kt, abs=2)
        assert group["IAS"].std() < 6
    # Valleys between the speeds planned: far fewer flights than on either side.
    planned = sorted(o.cas_kt for o in operators.values())
    for slow, fast in pairwise(planned):
        middle = (slow + fast) / 2
        near = [cas.filter((pl.col("IAS") - at).abs() < 3).height for at in (slow, middle, fast)]
        assert near[1] < 0.4 * min(near[0], near[2])


@pytest.mark.parametrize("typecode", open_typecodes())
def test_every_open_type_descends(typecode: str) -> None:
    aircraft = open_aircraft(typecode)
    world = simulate(aircraft, 4, 0, WorldConfig(step_s=3.0, bottom_fl=120.0))
    idle = world.truth.filter(pl.col("label") == "idle")
    assert idle["rate_mps"].min() / FPM_MPS > -6000
    assert idle["rate_mps"].max() / FPM_MPS < -300
    assert idle["mach"].max() < aircraft.mmo
    assert idle["cas_mps"].max() / KT_MPS < aircraft.vmo_kt


@pytest.mark.parametrize(
    ("settings", "word"),
    [
        ({"mass_range": (1.0, 0.5)}, "mass_range"),
        ({"thrust_spread": -0.1}, "thrust_spread"),
        ({"level_off_share": 1.5}, "level_off_share"),
        ({"deviation_mean_k": float("nan")}, "deviation_mean_k"),
        ({"step_s": 0.0}, "step_s"),
        ({"operators": ()}, "operator"),
    ],
)
def test_settings_that_make_no_world_are_refused(settings: dict[str, object], word: str) -> None:
    refuses(ConfigError, word, WorldConfig, **settings)


def test_bottom_above_the_top_and_aircraft_that_never_descends_are_refused(monkeypatch) -> None:
    refuses(ConfigError, "above the bottom", simulate, AIRCRAFT, 5, 0, WorldConfig(bottom_fl=390))
    monkeypatch.setattr("descentflow.simulation.flight.LONGEST_S", 300.0)
    refuses(ConfigError, "idle thrust", simulate, replace(AIRCRAFT, ct_des_high=0.9), 2, 0)
    refuses(ConfigError, "three different names", simulate, AIRCRAFT, 1, 0, out=Path())
    refuses(ConfigError, "expected a path", simulate, AIRCRAFT, 1, 0, out="")
    refuses(ConfigError, "n_flights = 0", simulate, AIRCRAFT, 0, 0)


def test_command_writes_rows_and_truth(tmp_path, capsys, monkeypatch, tmp_path_factory) -> None:
    keep_worlds(monkeypatch, tmp_path_factory.mktemp("flown"))  # one world if both ask for the same
    out = tmp_path / "rows.parquet"
    assert main(["simulate", "--flights", "3", "--seed", "7", "--out", str(out)]) == 0
    said = capsys.readouterr().out
    direct = simulate(open_aircraft("A320"), 3, 7)
    for name, frame in (("", direct.rows), ("_truth", direct.truth), ("_flights", direct.flights)):
        assert_frame_equal(pl.read_parquet(tmp_path / f"rows{name}.parquet"), frame)
    assert f"{len(direct.rows)} rows" in said
    assert sorted(p.name for p in tmp_path.iterdir()) == ["rows.parquet", "rows_flights.parquet", "rows_truth.parquet"]


@pytest.mark.slow
def test_ten_thousand_flights_are_all_there_and_no_two_are_alike() -> None:
    world = simulate(open_aircraft("A320"), 10_000, 0)
    first = world.rows.group_by("flight_id").agg(pl.col("altitude", "IAS", "Mach", "vertical_rate").head(200))
    assert len(first) == 10_000
    assert first.drop("flight_id").unique().height == 10_000
