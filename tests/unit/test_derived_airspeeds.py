"""Airspeeds of plain ADS-B: what is derived beside what was flown, what is left out, and what is refused."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import polars as pl
import pytest
from refusals import refuses

pytest.importorskip("xarray", reason="xarray is an extra of descentflow (wind)")

import weather_toys
from ground_toys import HOURS, field, plain, truth
from source_toys import packed, trace_of
from surveillance_toys import written
from weather_toys import linear, linear_wind, weather

from descentflow.cli import main
from descentflow.core.constants import KAPPA, R_AIR
from descentflow.core.errors import ConfigError, DataError, DescentflowWarning
from descentflow.core.units import FPM_MPS, FT_M, KT_MPS
from descentflow.diagnosis.sides.input_descriptions import input_of_flights
from descentflow.surveillance.descents.prepared_descents import Descents
from descentflow.surveillance.prepare import prepare

Change = Callable[[pl.DataFrame], pl.DataFrame]
PER_LEVEL_KT = 0.3
"""Of a rate that is not known between two rows, and of a field that is linear between pressure levels."""


@pytest.fixture(scope="module")
def flown() -> pl.DataFrame:
    return truth(4)


@pytest.fixture(scope="module")
def nc(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return field(tmp_path_factory.mktemp("field") / "era5.nc")


def beside(descents: Descents, flown: pl.DataFrame) -> pl.DataFrame:
    """Derived levels beside those of the airspeeds that were flown."""
    own = prepare(flown.drop("track", "groundspeed"))
    return own.frame.join(descents.frame, on=["icao24", "level_fl"], suffix="_derived")


def largest_error_kt(descents: Descents, flown: pl.DataFrame) -> float:
    both = beside(descents, flown)
    assert len(both) > 0.8 * len(descents.frame)
    return float((both["IAS_derived"] - both["IAS"]).abs().max())


def dropped(descents: Descents) -> dict[str, int]:
    return {step.step: step.rows_dropped for step in descents.report.steps if step.rows_dropped}


def test_airspeeds_of_a_field_are_those_flown_in_it(flown: pl.DataFrame, nc: Path) -> None:
    descents = prepare(plain(flown), airspeeds_from=nc)
    assert largest_error_kt(descents, flown) < PER_LEVEL_KT
    assert descents.frame["airspeed_source"].unique().to_list() == ["field"]
    assert descents.metadata["airspeeds_from"][0]["name"] == "era5.nc"
    both = beside(descents, flown)
    assert float((both["Mach_derived"] - both["Mach"]).abs().max()) < 1e-3
    # In still air they would be wrong by the wind, which is some 40 kt.
    wind = weather(linear, lambda *_: (0.0, 0.0), hours=HOURS)
    still = prepare(plain(flown), airspeeds_from=weather_toys.written(wind, nc.with_name("still.nc")))
    assert largest_error_kt(still, flown) > 15


def test_a_folder_of_files_is_one_field(flown: pl.DataFrame, tmp_path: Path) -> None:
    (tmp_path / "days").mkdir()
    for number, hours in enumerate((HOURS[:40], HOURS[40:])):
        field(tmp_path / "days" / f"{number}.nc", hours=hours)
    days = [prepare(plain(flown), airspeeds_from=source).frame for source in
            (tmp_path / "days", sorted((tmp_path / "days").iterdir()), field(tmp_path / "all.nc"))]  # fmt: skip
    assert days[0].equals(days[1])
    assert days[0].equals(days[2])


@pytest.mark.parametrize("turned", [0.0, 360.0])
def test_longitudes_may_be_counted_from_0_to_360(turned: float, flown: pl.DataFrame, nc: Path, tmp_path: Path) -> None:
    longitude = weather_toys.LONGITUDE
    data = weather(linear, linear_wind, hours=HOURS)
    other = data.assign_coords(longitude=np.where(longitude < 0, longitude + turned, longitude))
    prepared = prepare(plain(flown), airspeeds_from=weather_toys.written(other, tmp_path / "other.nc")).frame
    assert np.allclose(prepared["IAS"], prepare(plain(flown), airspeeds_from=nc).frame["IAS"], atol=1e-9)


def test_columns_of_the_rows_are_a_field(flown: pl.DataFrame) -> None:
    descents = prepare(flown.drop("IAS", "Mach"), airspeeds_from="columns")
    assert largest_error_kt(descents, flown) < PER_LEVEL_KT
    assert descents.metadata["airspeeds_from"] == "columns"


def state_vectors(rows: pl.DataFrame) -> pl.DataFrame:
    """As OpenSky's database has them."""
    return rows.select(
        time=pl.col("timestamp").dt.epoch("us") / 1e6, icao24="icao24", lat="latitude", lon="longitude",
        velocity=pl.col("groundspeed") * KT_MPS, heading="track", vertrate=pl.col("vertical_rate") * FPM_MPS,
        callsign="callsign", onground=pl.lit(False), squawk=pl.lit("1000"), baroaltitude=pl.col("altitude") * FT_M,
        geoaltitude=pl.col("altitude") * FT_M + 200, lastposupdate=pl.col("timestamp").dt.epoch("us") / 1e6 - 0.3,
        lastcontact=pl.col("timestamp").dt.epoch("us") / 1e6 - pl.when(pl.int_range(pl.len()) % 10 == 0).then(5.0)
        .otherwise(0.2),
    )  # fmt: skip


def test_state_vectors_are_read_and_old_ones_counted(flown: pl.DataFrame, nc: Path, tmp_path: Path) -> None:
    path = written(state_vectors(flown), tmp_path / "states.parquet")
    types = dict.fromkeys(flown["icao24"].unique(), "A320")
    descents = prepare(path, types=types, airspeeds_from=nc)
    assert largest_error_kt(descents, flown) < PER_LEVEL_KT
    assert descents.report.notes["state vectors without a message for 2 s, left out"] == -(-len(flown) // 10)


def test_tables_of_the_prc_are_read_with_their_list_of_flights(flown: pl.DataFrame, tmp_path: Path) -> None:
    """Of 2024, with columns of weather, and of 2025, without addresses."""
    numbers = flown["icao24"].rle_id() + 248_763_780
    rows = flown.drop("IAS", "Mach", "typecode", "callsign").with_columns(flight_id=numbers)
    flights = pl.DataFrame({"flight_id": numbers.unique(), "aircraft_type": "A320", "wtc": "M"})
    flights.write_csv(tmp_path / "challenge_set.csv")
    path = written(rows.with_columns(specific_humidity=1e-5), tmp_path / "2022-01-01.parquet")
    named = prepare(path, types=tmp_path / "challenge_set.csv", airspeeds_from="columns")
    assert largest_error_kt(named, flown) < PER_LEVEL_KT
    without = rows.drop("icao24").with_columns(
        pl.format("prc{}", "flight_id").alias("flight_id"), typecode=pl.lit("A320")
    )
    several = prepare(without.with_columns(CAS=pl.lit(None, pl.Float64)), airspeeds_from="columns")
    assert np.allclose(several.frame["IAS"], named.frame["IAS"])
    assert several.report.notes["addresses made of flight_id, for there is no icao24"] == len(flown)


def test_traces_without_airspeeds_are_read(flown: pl.DataFrame, nc: Path, tmp_path: Path) -> None:
    flight = flown.filter(pl.col("icao24") == "4ca000")
    trace = trace_of(flight)
    for point, row in zip(trace["trace"], flight.iter_rows(named=True), strict=True):
        point[1:3], point[4:6], point[12] = (
            [row["latitude"], row["longitude"]],
            [row["groundspeed"], row["track"]],
            None,
        )
        if point[8]:
            point[8] = {"type": "adsb_icao", "flight": "TST1    "}
    (tmp_path / "trace_full_4ca000.json").write_bytes(packed(trace))
    descents = prepare(tmp_path / "trace_full_4ca000.json", airspeeds_from=nc)
    assert largest_error_kt(descents, flight) < PER_LEVEL_KT + 0.3  # altitudes are whole feet, times centiseconds


def test_rows_that_have_airspeeds_keep_them(flown: pl.DataFrame, nc: Path) -> None:
    reports = pl.col("icao24") == "4ca001"
    mixed = flown.with_columns(pl.when(reports).then(pl.col(name) + shift).alias(name)
                               for name, shift in (("IAS", 3.0), ("Mach", 0.008)))  # fmt: skip
    frame = prepare(mixed, airspeeds_from=nc).frame
    sources = frame.group_by("icao24").agg(pl.col("airspeed_source").unique()).sort("icao24")
    assert sources["airspeed_source"].to_list() == [["field"], ["reported"], ["field"], ["field"]]
    own = frame.filter(reports)
    assert own["IAS"].unique().round(6).to_list() == [273.0]
    # What the field says of them stands beside.
    assert float((own["derived_IAS"] - 270.0).abs().max()) < PER_LEVEL_KT
    assert frame.filter(~reports)["derived_IAS"].null_count() == len(frame) - len(own)


def test_rows_between_reports_of_the_same_flight_are_left_out(flown: pl.DataFrame, nc: Path) -> None:
    sparse = pl.int_range(pl.len()) % 4 == 0
    some = flown.with_columns(pl.when(sparse).then(name).alias(name) for name in ("IAS", "Mach"))
    descents = prepare(some, airspeeds_from=nc)
    assert descents.frame["airspeed_source"].unique().to_list() == ["reported"]
    assert dropped(descents)["beside_reported_airspeeds"] == len(flown) - len(flown.filter(sparse))


def test_what_is_left_out_is_counted_by_its_cause(flown: pl.DataFrame, tmp_path: Path) -> None:
    rows = plain(flown).with_row_index("n").with_columns(roll=pl.when(pl.col("n") % 50 == 0).then(20.0).otherwise(1.0))
    first = rows.filter(pl.col("icao24") == "4ca000")["timestamp"].dt.epoch("s")
    hour = int((int(first[0]) - weather_toys.START.astype(int)) // 3600)
    # From the second flight on; the third between two times of which one is missing.
    hours = np.array([hour + 1.0, hour + 2, *range(hour + 4, hour + 8)])
    descents = prepare(rows.drop("n"), airspeeds_from=field(tmp_path / "short.nc", hours=hours))
    counts = dropped(descents)
    at = (flown["timestamp"].dt.epoch("us").to_numpy() / 1e6 - weather_toys.START.astype(float)) / 3600
    straight, level = np.arange(len(rows)) % 50 != 0, flown["altitude"].to_numpy() / 100
    early, gap = at < hours[0], (at > hours[1]) & (at < hours[2])
    assert counts["turning"] == (~straight).sum()
    assert counts["outside_field_time"] == (straight & early).sum()
    assert counts["coarse_field"] == (straight & gap).sum()
    lowest = weather_toys.levels_fl().min()
    assert counts["outside_field_place"] == (straight & ~early & ~gap & (level < lowest)).sum()


def test_a_field_of_every_twelve_hours_is_too_coarse(flown: pl.DataFrame, tmp_path: Path) -> None:
    path = field(tmp_path / "coarse.nc", hours=HOURS[::12])
    with pytest.raises(DataError, match=r"lie between times of the weather field too far apart.*every six"):
        prepare(plain(flown), airspeeds_from=path)


def test_turns_by_the_track_are_left_out(flown: pl.DataFrame, nc: Path) -> None:
    """A turn of 3 degrees a second at 400 kt banks by 47 degrees."""
    seconds = pl.col("timestamp").dt.epoch("s") - pl.col("timestamp").dt.epoch("s").min().over("icao24")
    turned = plain(flown).drop("latitude", "longitude").with_columns(
        latitude=51.0, longitude=4.0,
        track=(pl.col("track") + 3.0 * (seconds - 400).clip(0, 60)) % 360)  # fmt: skip
    descents = prepare(turned, airspeeds_from=nc)
    assert 4 * 12 <= dropped(descents)["turning"] <= 4 * 15


def test_a_groundspeed_that_is_stuck_is_left_out(flown: pl.DataFrame, nc: Path) -> None:
    low = pl.col("altitude").is_between(20_000, 24_000)
    held = plain(flown).with_columns(
        pl.when(low).then(pl.col(name).filter(low).first().over("icao24")).otherwise(name).alias(name)
        for name in ("groundspeed", "track")
    )
    counts = dropped(prepare(held, airspeeds_from=nc))
    assert counts["stuck_groundspeed"] == len(flown.filter(low)) - flown["icao24"].n_unique()


BAD: dict[str, tuple[Change, str]] = {
    "groundspeed in m/s": (lambda f: f.with_columns(pl.col("groundspeed") * KT_MPS), r"groundspeed.*in m/s.*1\.94"),
    "groundspeed in km/h": (lambda f: f.with_columns(pl.col("groundspeed") * 1.852), r"groundspeed.*in km/h"),
    "groundspeed in mph": (lambda f: f.with_columns(pl.col("groundspeed") * 1.15078), r"in miles per hour"),
    "altitude in metres": (lambda f: f.with_columns(pl.col("altitude") * FT_M), r"altitude seems to be in metres"),
    "rates in m/s": (lambda f: f.with_columns(pl.col("vertical_rate") * FPM_MPS), r"vertical_rate seems to be in m/s"),
    "heading in place of track": (lambda f: f.with_columns(pl.col("track") + 6), r"track contradicts the positions"),
    "tracks in radians": (lambda f: f.with_columns(pl.col("track").radians()), r"track seems to be in radians"),
    "no track": (lambda f: f.drop("track"), r"no column track"),
    "no groundspeed": (lambda f: f.drop("groundspeed"), r"no column groundspeed"),
    "no pressure altitude": (lambda f: f.rename({"altitude": "geoaltitude"}),
                             r"no column altitude.*a geometric altitude is none"),
    "a copied altitude": (lambda f: f.with_columns(geoaltitude="altitude"), r"altitude is the geometric altitude"),
    "no places": (lambda f: f.drop("latitude", "longitude"), r"latitude in .*fill the column latitude"),
    "another day": (lambda f: f.with_columns(pl.col("timestamp").dt.offset_by("40d")),
                    r"times that the weather field does not have"),
    "another region": (lambda f: f.with_columns(pl.col("longitude") - 90), r"places or levels that the weather field"),
    "places that are swapped": (lambda f: f.rename({"latitude": "longitude", "longitude": "latitude"}),
                                r"latitude and longitude seem to be swapped"),
    "tracks that are NaN": (lambda f: f.with_columns(track=pl.lit(float("nan"))), r"fill the column track"),
    "days as times": (lambda f: f.with_columns(
        timestamp=pl.col("timestamp").dt.epoch("us") / 86_400e6 + 25_569), r"days since 1899"),
}  # fmt: skip


@pytest.mark.parametrize("name", BAD)
def test_bad_rows_are_refused_by_name(name: str, flown: pl.DataFrame, nc: Path) -> None:
    change, match = BAD[name]
    refuses(DataError, rf"(?s){match}", prepare, change(plain(flown)), airspeeds_from=nc)


def test_bad_columns_of_weather_are_refused(flown: pl.DataFrame) -> None:
    bare = flown.drop("IAS", "Mach")
    with pytest.raises(DataError, match="temperature seems to be in degrees Celsius"):
        prepare(bare.with_columns(pl.col("temperature") - 273.15), airspeeds_from="columns")
    with pytest.raises(DataError, match=r"lack a value.*fill the column temperature, which is empty"):
        prepare(bare.with_columns(temperature=pl.lit(None, pl.Float64)), airspeeds_from="columns")
    with pytest.raises(DataError, match="fill the column u_component_of_wind"):
        prepare(bare.drop("u_component_of_wind"), airspeeds_from="columns")
    with pytest.raises(DataError, match="fill the column groundspeed"):
        prepare(bare.with_columns(pl.format("{} kt", "groundspeed").alias("groundspeed")), airspeeds_from="columns")


@pytest.mark.parametrize(("wind", "slope"), [
    (lambda east, north: (east / KT_MPS, north / KT_MPS), r"0\.5\d"),
    (lambda east, north: (-east, -north), r"-1\.\d+"),
    (lambda east, north: (north, -east), r"-?0\.\d+"),
])  # fmt: skip
def test_a_wind_that_groundspeeds_do_not_follow_is_refused(wind: Callable[..., object], slope: str) -> None:
    rows = truth(40, every_s=20.0)
    east, north = wind(rows["u_component_of_wind"], rows["v_component_of_wind"])
    bare = rows.drop("IAS", "Mach")
    assert prepare(bare, airspeeds_from="columns").flights == {"A320": 40}
    with pytest.raises(DataError, match=rf"do not follow the wind.*grow by {slope} "):
        prepare(bare.with_columns(u_component_of_wind=east, v_component_of_wind=north), airspeeds_from="columns")


def test_bad_sources_are_refused(flown: pl.DataFrame, nc: Path, tmp_path: Path) -> None:
    rows = plain(flown)
    refuses(DataError, r"no file nowhere\.nc.*'columns' or 'neighbours'", prepare, rows, airspeeds_from="nowhere.nc")
    (tmp_path / "empty").mkdir()
    refuses(DataError, r"no file of weather .* in /[^(]*empty;", prepare, rows, airspeeds_from=tmp_path / "empty")
    refuses(ConfigError, "expected one source", prepare, rows, airspeeds_from=["columns", nc])
    refuses(ConfigError, "airspeeds from 3", prepare, rows, airspeeds_from=3)
    dateless = weather(linear, linear_wind, hours=np.zeros(1)).isel(valid_time=0).drop_vars("valid_time")
    with pytest.raises(DataError, match="a weather field without a time"):
        prepare(rows, airspeeds_from=weather_toys.written(dateless, tmp_path / "dateless.nc"))
    windless = weather(linear, hours=HOURS)
    with pytest.raises(DataError, match="without eastward_wind"):
        prepare(rows, airspeeds_from=weather_toys.written(windless, tmp_path / "windless.nc"))
    refuses(DataError, r"no column IAS, Mach.*--airspeeds-from", prepare, rows)


def test_the_command_derives_out_of_core_as_in_memory(
    flown: pl.DataFrame, nc: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path, out = written(plain(flown), tmp_path / "rows.parquet"), tmp_path / "descents.parquet"
    main(["prepare", str(path), "--airspeeds-from", str(nc), "--out", str(out)])
    assert "outside_field_place" in capsys.readouterr().out
    whole = prepare(path, airspeeds_from=nc).frame
    assert pl.read_parquet(out).equals(whole)


def test_a_diagnosis_leaves_out_what_the_field_made_and_names_its_error(flown: pl.DataFrame, nc: Path) -> None:
    reports = pl.col("icao24") == "4ca001"
    tas = pl.col("Mach") * (KAPPA * R_AIR * pl.col("temperature")).sqrt() / KT_MPS
    rows = flown.with_columns(TAS=tas).with_columns(pl.when(reports).then(name).alias(name) for name in ("IAS", "Mach"))
    mixed, bare = (prepare(table, airspeeds_from=nc) for table in (rows, rows.drop("IAS", "Mach")))
    assert {"TAS", "Mach"} <= set(bare.frame.columns)
    assert not {"TAS", "Mach"} & set(bare.reported.columns)
    own = mixed.reported.filter(pl.col("Mach").is_not_null())["icao24"].unique().to_list()
    assert own == ["4ca001"]
    with pytest.warns(
        DescentflowWarning, match=r"a.parquet: flights, 3 of its flights with derived airspeeds: .* field"
    ):
        described = input_of_flights("a.parquet", mixed)
    assert "is the error of the weather field that made them, or the simulator's" in described.kind
    assert described.derived == 3
