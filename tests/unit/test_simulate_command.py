"""`descentflow simulate`: rows of plain ADS-B with their field, and effects that are planted."""

from pathlib import Path

import numpy as np
import polars as pl
import pytest
from refusals import refuses

pytest.importorskip("xarray", reason="xarray is an extra of descentflow (wind)")

import pytest
import xarray
from toys import AIRCRAFT

from descentflow.cli.entry import main
from descentflow.cli.simulate_command import planted
from descentflow.core.errors import ConfigError, DataError
from descentflow.core.units import KT_MPS
from descentflow.simulation._plain_adsb import plain_adsb
from descentflow.simulation.plantable import PLANTABLE
from descentflow.simulation.world import World, simulate
from descentflow.simulation.world_config import WorldConfig
from descentflow.surveillance.prepare import prepare

N = 40
EARTH_M = 6_371_000.0


@pytest.fixture(scope="module")
def still() -> pl.DataFrame:
    return simulate(AIRCRAFT, N, seed=4).rows


@pytest.fixture(scope="module")
def bare(tmp_path_factory: pytest.TempPathFactory) -> tuple[World, Path]:
    out = tmp_path_factory.mktemp("bare") / "rows.parquet"
    return simulate(AIRCRAFT, N, seed=4, without_airspeeds=True, wind_error_mps=0.0,
                    out=out), out.with_name("rows_field.nc")  # fmt: skip


def test_a_field_without_errors_gives_the_airspeeds_that_were_flown(
    still: pl.DataFrame, bare: tuple[World, Path]
) -> None:
    own, derived = prepare(still).frame, prepare(bare[0].rows, airspeeds_from=bare[1]).frame
    off = own.join(derived, on=["flight_id", "level_fl"], suffix="_derived").select(
        pl.col("IAS_derived") - pl.col("IAS")
    )["IAS_derived"]
    assert len(off) > 0.9 * len(own)
    assert abs(off.mean()) < 0.1
    # Groundspeed is in steps of 2 kt and IAS of 1 kt.
    assert off.std() < 1.0


def test_rows_are_moved_by_the_wind_that_the_field_has(still: pl.DataFrame, bare: tuple[World, Path]) -> None:
    world, _ = bare
    assert not {"IAS", "Mach", "TAS", "heading"} & set(world.rows.columns)
    assert world.rows.select("timestamp", "altitude", "vertical_rate").equals(
        still.select("timestamp", "altitude", "vertical_rate")
    )
    # The error-free field has one wind at a time.
    hours = world.field["valid_time"].to_numpy().astype("datetime64[s]").astype(float)
    wind = [world.field[name].to_numpy() for name in ("u", "v")]
    assert max(float(np.ptp(component, axis=(1, 2, 3)).max()) for component in wind) < 1e-5
    at = world.rows["timestamp"].dt.epoch("us").to_numpy() / 1e6
    east, north = (np.interp(at, hours, component[:, 0, 0, 0]) for component in wind)
    assert np.hypot(east, north).max() > 5

    def vector(rows: pl.DataFrame) -> np.ndarray:
        speed, track = rows["groundspeed"].to_numpy() * KT_MPS, np.radians(rows["track"].to_numpy())
        return speed * np.array([np.sin(track), np.cos(track)])

    left = vector(world.rows) - vector(still) - [east, north]
    assert np.abs(left).max() < 2.0  # by steps of 2 kt and 0.18 degrees
    assert np.abs(left.mean(1)).max() < 0.05
    # Places go where the ground vector points.
    seconds = np.diff(at)
    same = (np.diff(world.rows["flight_id"].rle_id().to_numpy()) == 0) & (seconds > 1)
    latitude, longitude = (np.radians(world.rows[name].to_numpy()) for name in ("latitude", "longitude"))
    moved = EARTH_M * np.array([np.diff(longitude) * np.cos(latitude[1:]), np.diff(latitude)]) / seconds
    apart = (moved - vector(world.rows)[:, 1:])[:, same]
    assert np.abs(np.median(apart, 1)).max() < 0.5
    assert np.median(np.abs(apart)) < 1.5


def test_errors_have_the_sizes_and_lengths_that_were_asked_for(still: pl.DataFrame) -> None:
    squares, levels = [], []
    for seed in range(16):
        exact, wrong = (plain_adsb(still, seed, 5.0, size)[1] for size in (0.0, 3.0))
        errors = wrong - exact
        rng = np.random.default_rng(seed)
        places = {name: ("place", rng.uniform(0, errors.sizes[name] - 1, 400)) for name in errors.dims}
        numbered = errors.assign_coords({name: np.arange(errors.sizes[name]) for name in errors.dims})
        at = numbered.interp({name: xarray.DataArray(values, dims=dim) for name, (dim, values) in places.items()})
        squares.append([float(np.square(at[name]).mean()) for name in "tuv"])
        levels.append(errors["u"].sel(pressure_level=[200, 300, 400, 750])[:, :, 3, 3].to_numpy())
    # Of sixteen fields whose common part has a handful of values each.
    assert np.sqrt(np.mean(squares, 0)) == pytest.approx([1.2, 3.0, 3.0], rel=0.12)
    # 300 and 400 hPa are 6,500 ft apart, 0.65 by Matern; at 30,000 ft the common quarter alone is left. At the points
    # the variance is 1.24, for the white part is as asked in the mean between them.
    alike = np.corrcoef(np.concatenate(levels), rowvar=False)
    assert alike[1, 2] == pytest.approx((0.25 + 0.7 * 0.65) / 1.24, abs=0.08)
    assert alike[0, 3] == pytest.approx(0.25 / 1.24, abs=0.15)


def test_the_command_writes_the_field_and_prepare_takes_it(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "rows.parquet"
    main(["simulate", "--flights", "10", "--without-airspeeds", "--wind-error-mps", "4", "--out", str(out)])
    assert "rows_field.nc" in capsys.readouterr().out
    refuses(DataError, "airspeeds-from", prepare, out)
    main(
        ["prepare", str(out), "--airspeeds-from", str(tmp_path / "rows_field.nc"), "--out", str(tmp_path / "d.parquet")]
    )
    assert pl.read_parquet(tmp_path / "d.parquet")["airspeed_source"].unique().to_list() == ["field"]


def test_worlds_whose_flights_have_their_own_air_are_refused(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=r"without airspeeds of a world with jet_mps, shear_spread_per_s"):
        simulate("A320", 5, scenario="london-fir-2019", without_airspeeds=True)
    with pytest.raises(ConfigError, match="wind_mean_mps"):
        simulate("A320", 5, scenario=WorldConfig(wind_mean_mps=5.0), without_airspeeds=True)
    (tmp_path / "rows_field.nc").mkdir()
    refuses(DataError, "rows_field", simulate, "A320", 5, without_airspeeds=True, out=tmp_path / "rows.parquet")


def test_days_are_not_written_without_airspeeds(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    command = ["simulate", "--flights", "10", "--days", "2", "--without-airspeeds", "--out", str(tmp_path / "days")]
    assert main(command) != 0
    assert "--without-airspeeds" in capsys.readouterr().err


@pytest.mark.parametrize(
    "word", ["temperature:deviation_k", "temperature:deviation_k=10,deviation_k=12", "temperature=10"]
)
def test_words_that_are_none_are_refused(word: str) -> None:
    refuses(ConfigError, r"--plant .*expected .*=(NUMBER|VALUE)", planted, [word])


def test_an_effect_comes_once() -> None:
    refuses(ConfigError, "each effect once", planted, ["mass", "mass:factor=1.1"])


def test_help_lists_every_effect_with_its_values_units_and_defaults(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        main(["simulate", "--help"])
    text = capsys.readouterr().out
    for name, effect in PLANTABLE.items():
        assert f"  {name}: {effect.description}\n" in text
        assert all(value.text in text for value in effect.values)
    assert "deviation_k=10 [K] mean deviation" in text


def test_planted_flights_say_so_and_mistakes_end_with_a_message(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    rows = tmp_path / "rows.parquet"
    plant = ["--plant", "vertical_rate_lag:lag_s=8", "--plant", "mass:factor=1.05,share=0.5"]
    assert main(["simulate", "--flights", "6", "--out", str(rows), *plant]) == 0
    said = capsys.readouterr().out
    assert "planted: vertical_rate_lag (lag_s=8, spread_s=0), mass (factor=1.05, spread=0, share=0.5)" in said
    flights = pl.read_parquet(tmp_path / "rows_flights.parquet")
    assert flights["planted_vertical_rate_lag_lag_s"].to_list() == [8.0] * 6
    assert set(flights["planted_mass_factor"].to_list()) <= {1.05, None}
    for word, message in (
        ("warmth", "to plant warmth; expected one of temperature"),
        ("mass:kilograms=3", "mass with kilograms; expected of mass: factor=0.9 mean factor"),
        ("mass:share=2", "share=2; expected a finite number, at least 0 and at most 1"),
    ):
        assert main(["simulate", "--out", str(rows), "--plant", word]) == 2
        assert message in capsys.readouterr().err
