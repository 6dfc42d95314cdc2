"""Samples in the library traffic itself; needs the extra `traffic`, which holds pandas below 3."""

import re
from pathlib import Path

import numpy as np
import polars as pl
import pytest
from export_toys import WHERE
from pyproj import Geod

import descentflow as df
from descentflow.core.errors import ConfigError
from descentflow.core.tabular import to_pandas
from descentflow.exports.export import export
from descentflow.exports.traffic_export import FEATURES, TrafficGeneration
from descentflow.positions.ground_plan import ground_plan

PLACES = {name: value for name, value in WHERE.items() if name != "end_time"}


def core() -> object:
    """The library, or a skip: it does not import beside pandas 3, which these tests are run with otherwise."""
    return pytest.importorskip(
        "traffic.core",
        reason="traffic needs pandas below 3: pip install '.[traffic]' in an environment of its own",
        exc_type=ImportError,
    )


def test_flights_have_the_columns_of_traffic_in_its_units(a320: Path, tmp_path: Path) -> None:
    (path,) = export(a320, "traffic", tmp_path / "t.parquet", n=5, prefix="DF", **WHERE)
    table = pl.read_parquet(path)
    assert {"timestamp", "icao24", "callsign", "altitude", "latitude", "longitude"} <= set(table.columns)
    assert table.schema["timestamp"] == pl.Datetime("us", "UTC")
    assert table["icao24"].str.contains("^f[0-9a-f]{5}$").all()
    assert (table["timestamp"].dt.epoch("us") % 1_000_000 == 0).all(), "a row each second, on the second"
    assert table.group_by("callsign").agg(pl.col("timestamp").diff().dt.total_seconds().max())["timestamp"].max() == 1
    for number, own in enumerate(df.sample(a320, 5).placed(**WHERE).to_polars().partition_by("sample_id")):
        sample = table.filter(callsign=f"DF{number:05d}")
        at = own["timestamp"].dt.epoch("us").to_numpy() + 120_000_000 * number
        assert 0 <= sample["timestamp"].dt.epoch("us")[0] - at[0] < 1_000_000
        for name, column in (
            ("altitude", "altitude_ft"),
            ("IAS", "CAS"),
            ("latitude", "latitude"),
            ("fuel_kg", "fuel_kg"),
        ):
            np.testing.assert_allclose(np.interp(sample["timestamp"].dt.epoch("us"), at, own[column]), sample[name])


def test_flights_of_two_exports_can_lie_in_one_table(a320: Path, tmp_path: Path) -> None:
    """Of one model and seed, on two tracks or at two times: nothing that names a flight names two."""
    ways = [{}, {"track": 90.0}, {"end_time": "2026-11-22T11:00:00Z"}, {"every_s": 60.0}, {"seed": 1}]
    tables = [
        pl.read_parquet(*export(a320, "traffic", tmp_path / f"{i}.parquet", n=20, **(WHERE | way)))
        for i, way in enumerate(ways)
    ]
    names = pl.concat(tables).select("flight_id", "callsign", "icao24").unique()
    assert names["callsign"].n_unique() == names["flight_id"].n_unique() == names["icao24"].n_unique() == 20 * len(ways)
    (again,) = export(a320, "traffic", tmp_path / "again.parquet", n=20, **WHERE)
    assert pl.read_parquet(again).equals(tables[0]), "the same seed gives the same files"


def test_rows_of_a_coarser_step_and_over_the_antimeridian(a320: Path, tmp_path: Path) -> None:
    pytest.importorskip("arro3.core", reason="arro3 is an extra of descentflow (parquet-units)")
    where = {"end": (-17.75, 179.9), "track": 265.0, "wind": "270/20"}
    (path,) = export(a320, "parquet", tmp_path / "t.parquet", n=3, step_s=5.0, **where)
    for flight in pl.read_parquet(path).partition_by("sample_id"):
        np.testing.assert_array_equal(flight["time_s"], 5.0 * np.arange(len(flight)))
        steps_nm = Geod(ellps="WGS84").inv(*(flight[name][cut] for cut in (slice(-1), slice(1, None))
                                             for name in ("longitude", "latitude")))[2] / 1852  # fmt: skip
        np.testing.assert_allclose(steps_nm, np.diff(flight["distance_nm"]), atol=1e-3)
        assert flight["longitude"].max() > 179
        assert flight["longitude"].min() < -179
    for step_s, message in ((0.0, "rows every 0 s"), (10_000.0, "rows every 10000 s of a descent of")):
        with pytest.raises(ConfigError, match=message):
            export(a320, "parquet", tmp_path / "no.parquet", n=2, step_s=step_s)
    assert not (tmp_path / "no.parquet").exists()


@pytest.mark.filterwarnings("ignore")
def test_traffic_reads_resamples_finds_phases_and_evaluates(a320: Path, tmp_path: Path) -> None:
    traffic = core()
    export(a320, "traffic", tmp_path / "t.parquet", n=6, prefix="DF", **WHERE)
    flights = traffic.Traffic.from_file(tmp_path / "t.parquet")
    assert len(flights) == 6
    made = flights.resample("2s").phases().eval(max_workers=1)
    phases = made.data["phase"].value_counts(normalize=True)
    assert phases["DESCENT"] > 0.8
    sample = df.sample(a320, 6).placed(**WHERE).to_polars().filter(sample_id=2)
    again = flights["A320-DF00002"]
    assert 0 <= sample["time_s"].max() - again.duration.total_seconds() < 2, "from second to second"
    # Its own great-circle lengths of the track, in NM, are the distance that was flown.
    assert again.cumulative_distance().data["cumdist"].max() == pytest.approx(
        sample["distance_nm"].max() - (sample["time_s"].max() - again.duration.total_seconds()) * 0.11, abs=0.1
    )


@pytest.mark.filterwarnings("ignore")
def test_flights_of_traffic_are_prepared_as_their_table(tmp_path: Path) -> None:
    rows = df.simulate("A320", 5, seed=1).rows
    flights = core().Traffic(to_pandas(rows))
    assert df.prepare(flights).frame.equals(df.prepare(rows).frame)
    assert df.prepare(next(iter(flights))).flights == {"A320": 1}


@pytest.mark.filterwarnings("ignore")
def test_positions_that_traffic_resampled_have_their_groundspeed(a320: Path, tmp_path: Path) -> None:
    """By its page's line; 0.3 kt is what speed changes within a step. Rows at odd times were off by 120 kt."""
    traffic = core()
    export(a320, "traffic", tmp_path / "t.parquet", n=10, every_s=97.3, **WHERE)
    for flight in traffic.Traffic.from_file(tmp_path / "t.parquet").resample("2s").eval(max_workers=1):
        # A flight that begins within a step is dated back to its beginning, as traffic does with any recording.
        rows = flight.data.sort_values("timestamp")[1:]
        lon, lat = rows["longitude"].to_numpy(), rows["latitude"].to_numpy()
        flown_kt = Geod(ellps="WGS84").inv(lon[:-1], lat[:-1], lon[1:], lat[1:])[2] / 1852 * 1800
        said = rows["groundspeed"].to_numpy()
        assert np.abs(flown_kt - (said[1:] + said[:-1]) / 2).max() < 0.5


@pytest.mark.filterwarnings("ignore")
def test_traffics_generation_flies_our_samples(a320: Path) -> None:
    core()
    from traffic.algorithms.generation import Generation

    ours = TrafficGeneration(a320, ground_plan(**PLACES), n_obs=200, seed=3)
    made = Generation(ours, list(FEATURES)).sample(5, coordinates={"latitude": 52.3, "longitude": 4.76}, forward=False)
    assert len(made) == 5
    own = df.sample(a320, 5, seed=3).trajectories
    lengths = sorted(flight.duration.total_seconds() for flight in made)
    np.testing.assert_allclose(lengths, sorted(own.time_s[:, 0].tolist()), atol=1e-3)
    placed = Generation(
        TrafficGeneration(a320, ground_plan(**PLACES), ("latitude", "longitude", "altitude", "timedelta"), seed=3),
        ["latitude", "longitude", "altitude", "timedelta"],
    ).sample(5)
    assert placed.data["latitude"].min() > 52.3, "40 NM north of the end point and more"


def test_rows_of_the_matrix_are_flights_on_equal_times(a320: Path) -> None:
    ours = TrafficGeneration(a320, ground_plan(**PLACES), n_obs=50)
    first, labels = ours.sample(8)
    grid = first.reshape(8, 50, 4)
    assert labels.tolist() == [0.0] * 8
    times = grid[:, :, FEATURES.index("timedelta")]
    np.testing.assert_allclose(np.diff(times, 2, axis=1), 0, atol=1e-9)
    assert (np.diff(grid[:, :, FEATURES.index("altitude")]) < 0).all()
    np.testing.assert_allclose(grid[:, :, 0], 184.0, atol=1.5)
    again, _ = ours.sample(8)
    assert not np.array_equal(first, again), "another call draws other flights"
    assert ours.fit(first[:3, :120]).sample(2)[0].shape == (2, 120)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda a320: TrafficGeneration(a320, ground_plan()), "a plan without a path"),
        (lambda a320: TrafficGeneration(a320, ground_plan(**PLACES), ("squawk",)), "features squawk"),
        (lambda a320: TrafficGeneration(a320, ground_plan(**PLACES)).fit(np.zeros((3, 7))), "7 columns of 4 features"),
        (
            lambda a320: TrafficGeneration(a320, ground_plan(**PLACES)).fit(
                np.random.default_rng(0).normal(size=(9, 40))
            ),
            "groundspeed that was scaled",
        ),
    ],
)
def test_what_it_cannot_serve_is_refused(a320: Path, make, message: str) -> None:
    with pytest.raises(ConfigError, match=re.escape(message)):
        make(a320)


@pytest.mark.filterwarnings("ignore")
def test_a_scaler_of_traffics_generation_is_refused(a320: Path) -> None:
    """It scales back what was never scaled: altitudes of 301 million ft."""
    traffic = core()
    preprocessing = pytest.importorskip(
        "sklearn.preprocessing", reason="scikit-learn has the scalers of traffic's page"
    )
    from traffic.algorithms.generation import Generation

    features = ["latitude", "longitude", "altitude", "timedelta"]
    ours = TrafficGeneration(a320, ground_plan(**PLACES), features, n_obs=20)
    flights = Generation(ours, features).sample(30)
    assert isinstance(flights, traffic.Traffic)
    assert Generation(ours, features).fit(flights).sample(3).data["altitude"].max() < 45_000
    for scaler in (preprocessing.StandardScaler(), preprocessing.MinMaxScaler(feature_range=(-1, 1))):
        with pytest.raises(ConfigError, match="altitude that was scaled"):
            Generation(ours, features, scaler).fit(flights)


@pytest.mark.filterwarnings("ignore")
def test_what_traffic_writes_is_read_by_prepare(a320: Path, tmp_path: Path) -> None:
    traffic = core()
    export(a320, "traffic", tmp_path / "t.parquet", n=20, prefix="DF", **WHERE)
    flights = traffic.Traffic.from_file(tmp_path / "t.parquet").resample("4s").eval(max_workers=1)
    flights.to_parquet(tmp_path / "r.parquet")
    again = df.prepare(tmp_path / "r.parquet", typecode="A320").frame
    assert again["flight_id"].n_unique() == 20
    own = df.sample(a320, 20).to_polars().filter(sample_id=4, level_fl=200)
    row = again.filter(flight_id="A320-DF00004", level_fl=200)
    assert row["IAS"].item() == pytest.approx(own["CAS"].item(), abs=0.5)
