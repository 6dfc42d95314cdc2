"""Samples in the library traffic itself; needs the extra `traffic`, which holds pandas below 3."""

import re
from pathlib import Path

import numpy as np
import polars as pl
import pytest
from export_toys import WHERE

import descentflow as df
from descentflow.core.errors import ConfigError
from descentflow.exports.export import export
from descentflow.exports.traffic_generation import FEATURES, TrafficGeneration
from descentflow.positions.ground_plan import ground_plan

PLACES = {name: value for name, value in WHERE.items() if name != "end_time"}


def core() -> object:
    """The library, or a skip: it does not import beside pandas 3, which these tests are run with otherwise."""
    return pytest.importorskip(
        "traffic.core",
        reason="traffic needs pandas below 3: pip install 'descentflow[traffic]' in an environment of its own",
        exc_type=ImportError,
    )


def test_flights_have_the_columns_of_traffic_in_its_units(a320: Path, tmp_path: Path) -> None:
    (path,) = export(a320, "traffic", tmp_path / "t.parquet", n=5, **WHERE)
    found = pl.read_parquet(path)
    assert {"timestamp", "icao24", "callsign", "altitude", "latitude", "longitude"} <= set(found.columns)
    assert found.schema["timestamp"] == pl.Datetime("us", "UTC")
    assert found["icao24"].str.contains("^f0[0-9a-f]{4}$").all()
    own = df.sample(a320, 5).to_polars()
    np.testing.assert_array_equal(found["altitude"], own["altitude_ft"])
    np.testing.assert_array_equal(found["IAS"], own["CAS"])


@pytest.mark.filterwarnings("ignore")
def test_traffic_reads_resamples_finds_phases_and_evaluates(a320: Path, tmp_path: Path) -> None:
    traffic = core()
    export(a320, "traffic", tmp_path / "t.parquet", n=6, **WHERE)
    flights = traffic.Traffic.from_file(tmp_path / "t.parquet")
    assert len(flights) == 6
    made = flights.resample("2s").phases().eval(max_workers=1)
    phases = made.data["phase"].value_counts(normalize=True)
    assert phases["DESCENT"] > 0.8
    one = df.sample(a320, 6).placed(**WHERE).to_polars().filter(sample_id=2)
    again = flights["A320-0-00002"]
    assert again.duration.total_seconds() == pytest.approx(one["time_s"].max(), abs=1e-3)
    # Its own great-circle lengths of the track, in NM, are the distance that was flown.
    assert again.cumulative_distance().data["cumdist"].max() == pytest.approx(one["distance_nm"].max(), rel=2e-3)


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
    assert ours.fit(np.zeros((3, 120))).sample(2)[0].shape == (2, 120)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda a320: TrafficGeneration(a320, ground_plan()), "a plan without a path"),
        (lambda a320: TrafficGeneration(a320, ground_plan(**PLACES), ("squawk",)), "features squawk"),
        (lambda a320: TrafficGeneration(a320, ground_plan(**PLACES)).fit(np.zeros((3, 7))), "7 columns of 4 features"),
    ],
)
def test_what_it_cannot_serve_is_refused(a320: Path, make, message: str) -> None:
    with pytest.raises(ConfigError, match=re.escape(message)):
        make(a320)


@pytest.mark.filterwarnings("ignore")
def test_what_traffic_writes_is_read_by_prepare(a320: Path, tmp_path: Path) -> None:
    traffic = core()
    export(a320, "traffic", tmp_path / "t.parquet", n=20, **WHERE)
    flights = traffic.Traffic.from_file(tmp_path / "t.parquet").resample("4s").eval(max_workers=1)
    flights.to_parquet(tmp_path / "r.parquet")
    again = df.prepare(tmp_path / "r.parquet", typecode="A320").frame
    assert again["flight_id"].n_unique() == 20
    own = df.sample(a320, 20).to_polars().filter(sample_id=4, level_fl=200)
    found = again.filter(flight_id="A320-0-00004", level_fl=200)
    assert found["IAS"].item() == pytest.approx(own["CAS"].item(), abs=0.5)
