"""Columns that contradict each other: the one that is wrong is named, with the factor that mends it."""

from collections.abc import Callable
from datetime import timedelta

import numpy as np
import polars as pl
import pytest
from surveillance_toys import fleet

from descentflow.core.errors import DataError, DescentflowWarning
from descentflow.simulation.world import simulate
from descentflow.surveillance.prepare import prepare
from descentflow.surveillance.read_rows import read_rows
from descentflow.surveillance.rows._units_check import check_units
from descentflow.surveillance.rows.air_data import isa_tas_of_mach_kt
from descentflow.surveillance.rows.drop_report import DropReport

Change = Callable[[pl.DataFrame], pl.DataFrame]
KT_MPS, KT_KMH, KT_MPH, FPM_MPS = 0.514444, 1.852, 1.15078, 0.00508


@pytest.fixture(scope="module")
def rows() -> pl.DataFrame:
    """Three aircraft in air 8 K warmer than standard, with winds of -40 to 40 kt and all tracks."""
    frame = fleet(3)
    tas = isa_tas_of_mach_kt(frame["Mach"].to_numpy(), frame["altitude"].to_numpy()) * 1.017
    winds = 40.0 * (frame["icao24"].rank("dense") - 2.0)
    track = pl.Series(np.arange(len(frame)) * 7.0 % 360)
    return frame.with_columns(TAS=pl.Series(tas), groundspeed=pl.Series(tas) + winds, track=track)


def times(name: str, factor: float) -> Change:
    return lambda frame: frame.with_columns(pl.col(name) * factor)


def both(*changes: Change) -> Change:
    def changed(frame: pl.DataFrame) -> pl.DataFrame:
        for change in changes:
            frame = change(frame)
        return frame

    return changed


SWAPPED: Change = lambda frame: frame.rename({"IAS": "TAS", "TAS": "IAS"})  # noqa: E731
FLIGHT_LEVELS: Change = lambda frame: frame.with_columns((pl.col("altitude") / 100).round())  # noqa: E731
WRONG: dict[str, tuple[Change, str, str]] = {
    "groundspeed in km/h": (times("groundspeed", KT_KMH), "groundspeed seems to be in km/h", "groundspeed by 0.53996"),
    "TAS in km/h": (times("TAS", KT_KMH), "TAS seems to be in km/h", "TAS by 0.53996"),
    "IAS in m/s": (times("IAS", KT_MPS), "IAS seems to be in m/s", "IAS by 1.9438"),
    "Mach in percent": (times("Mach", 100), "Mach seems to be in hundredths", "Mach by 0.01"),
    "TAS that is IAS": (lambda f: f.with_columns(TAS="IAS"), "TAS seems to be IAS", "true airspeed"),
    "IAS and TAS swapped": (SWAPPED, "IAS and TAS seem to be swapped", "--column IAS=TAS --column TAS=IAS"),
    "flight levels": (FLIGHT_LEVELS, "altitude seems to be in hundreds of feet", "altitude by 100"),
    "altitude in metres": (times("altitude", 0.3048), "altitude seems to be in metres", "altitude by 3.2808"),
    "rate in m/s": (times("vertical_rate", FPM_MPS), "vertical_rate seems to be in m/s", "vertical_rate by 196.85"),
    "all SI": (
        both(times("altitude", 0.3048), times("IAS", KT_MPS), times("TAS", KT_MPS), times("groundspeed", KT_MPS)),
        "altitude seems to be in metres and IAS in m/s and TAS in m/s and groundspeed in m/s",
        "altitude by 3.2808 and IAS by 1.9438",
    ),
    "SI with its rate": (
        both(times("altitude", 0.3048), *(times(name, KT_MPS) for name in ("IAS", "TAS", "groundspeed")),
             times("vertical_rate", FPM_MPS)),
        "groundspeed in m/s and vertical_rate in m/s",
        "vertical_rate by 196.85",
    ),
    "speeds in m/s": (
        both(*(times(name, KT_MPS) for name in ("IAS", "TAS", "groundspeed"))),
        "IAS seems to be in m/s and TAS in m/s and groundspeed in m/s",
        "IAS by 1.9438 and TAS by 1.9438",
    ),
}  # fmt: skip


@pytest.mark.parametrize("mach", [True, False], ids=["with Mach", "without Mach"])
@pytest.mark.parametrize("kind", WRONG)
def test_the_column_that_is_wrong_is_named_with_its_factor(kind: str, mach: bool, rows: pl.DataFrame) -> None:
    change, words, mend = WRONG[kind]
    if not mach and "Mach" in words:
        pytest.skip("of the column that is left out")
    changed = change(rows) if mach else change(rows).drop("Mach")
    with pytest.raises(DataError) as caught:
        read_rows([changed], DropReport())
    assert words in caught.value.got
    assert "read so, all columns agree" in caught.value.got
    assert mend in caught.value.mend


@pytest.mark.parametrize("change", [
    times("IAS", KT_MPH),
    both(times("IAS", KT_KMH), times("altitude", 0.3048)),
    both(times("TAS", KT_KMH), times("groundspeed", KT_MPS)),
])  # fmt: skip
def test_units_that_were_never_met_are_refused_by_the_names_of_the_columns(change: Change, rows: pl.DataFrame) -> None:
    names = [name for name in rows.columns if not change(rows)[name].equals(rows[name])]
    with pytest.raises(DataError, match="contradict") as caught:
        read_rows([change(rows)], DropReport())
    assert all(name in caught.value.got for name in names)


def test_columns_that_agree_are_read(rows: pl.DataFrame) -> None:
    for frame in (rows, rows.drop("Mach"), rows.drop("Mach", "TAS"), rows.drop("Mach", "TAS", "groundspeed")):
        assert len(read_rows([frame], DropReport())) == len(rows)


ALONE = ("Mach", "TAS", "groundspeed")
WITHOUT_OTHERS: dict[str, tuple[Change, tuple[str, ...], str]] = {
    "flight levels, no rate": (FLIGHT_LEVELS, (*ALONE, "vertical_rate"), "altitude seems to be in hundreds of feet"),
    "flight levels": (FLIGHT_LEVELS, ALONE, "altitude seems to be in hundreds of feet"),
    "metres by the rate": (times("altitude", 0.3048), ALONE, "altitude seems to be in metres"),
    "faster than sound": (times("IAS", KT_KMH), ALONE, "IAS seems to be in km/h or IAS seems to be TAS or groundspeed"),
    "groundspeed as IAS": (
        lambda f: f.with_columns(IAS="groundspeed"),
        ("Mach",),
        "IAS seems to be TAS or groundspeed",
    ),
}


@pytest.mark.parametrize("kind", WITHOUT_OTHERS)
def test_few_columns_say_what_they_can(kind: str, rows: pl.DataFrame) -> None:
    change, without, words = WITHOUT_OTHERS[kind]
    with pytest.raises(DataError) as caught:
        read_rows([change(rows).drop(without)], DropReport())
    assert words in caught.value.got


@pytest.mark.parametrize(
    ("name", "factor"), [("IAS", 1.1), ("IAS", 1.2), ("IAS", 1.45), ("Mach", 1.1), ("TAS", 0.7), ("TAS", 1.4)]
)
def test_a_column_that_no_unit_explains_is_named_and_the_others_agree(
    name: str, factor: float, rows: pl.DataFrame
) -> None:
    with pytest.raises(DataError) as caught:
        check_units(times(name, factor)(rows), "rows")
    assert f"{name} contradicts the other columns" in caught.value.got
    assert "while the others agree" in caught.value.got
    assert f"what the column {name} holds" in caught.value.mend
    with pytest.warns(DescentflowWarning, match=f"{name} contradicts the other columns"):
        check_units(times(name, factor)(rows).filter(pl.col("icao24") == "4ca000"), "rows")


@pytest.mark.parametrize("percent", [10, 20, 45])
def test_two_columns_that_contradict_each_other_are_both_named(percent: int, rows: pl.DataFrame) -> None:
    """20 % are near a TAS in the mean, but not level by level."""
    with pytest.raises(DataError, match=f"contradicts? .*other.*: IAS and Mach differ by {percent}%"):
        check_units(times("IAS", 1 + percent / 100)(rows).drop("TAS", "groundspeed", "vertical_rate"), "rows")


def test_a_poor_instrument_is_no_contradiction(rows: pl.DataFrame) -> None:
    check_units(times("IAS", 1.08)(rows), "rows")


def test_altitudes_to_100_ft_that_change_in_level_flight_are_no_contradiction(rows: pl.DataFrame) -> None:
    level = rows.with_row_index("row").with_columns(
        altitude=30_000.0 + 100.0 * (pl.col("row") % 2),
        vertical_rate=pl.lit(0.0),
        timestamp=pl.col("timestamp").dt.offset_by("1d"),
    )
    # Between neighbouring rows they climb at 1,500 ft/min, and report nothing.
    check_units(pl.concat([rows, level.select(rows.columns).cast(rows.schema)]), "rows")


def test_rates_without_a_sign_are_known_by_climbs(rows: pl.DataFrame) -> None:
    last = rows["timestamp"].max()
    climbs = rows.with_columns(timestamp=last + (last - pl.col("timestamp")) + timedelta(hours=1))
    unsigned = pl.concat([rows, climbs]).with_columns(pl.col("vertical_rate").abs())
    with pytest.raises(DataError, match="vertical_rate seems to be without a sign"):
        check_units(unsigned, "rows")


def test_numbers_that_stand_for_none_are_no_rates_and_counted(rows: pl.DataFrame) -> None:
    half = pl.when(pl.int_range(pl.len()) % 2 == 0).then(9999.0).otherwise("vertical_rate")
    prepared = prepare(rows.with_columns(half.alias("vertical_rate")))
    assert prepared.report.notes["values 9999 of vertical_rate taken for missing"] == len(rows) // 2 + len(rows) % 2
    assert prepared.flights == prepare(rows).flights
    check_units(
        rows.with_columns(altitude=pl.when(pl.int_range(pl.len()) % 5 == 0).then(9999.0).otherwise("altitude")), "r"
    )


def test_tracks_in_radians_are_refused(rows: pl.DataFrame) -> None:
    with pytest.raises(DataError, match="track seems to be in radians"):
        check_units(times("track", np.pi / 180)(rows), "rows")
    north = rows.with_columns(track=pl.when(pl.col("track") < 180).then(3.0).otherwise(357.0))
    check_units(north, "rows")


@pytest.mark.parametrize("text", [True, False])
def test_days_of_a_spreadsheet_are_refused(text: bool, rows: pl.DataFrame) -> None:
    days = pl.col("timestamp").dt.epoch("us") / 86_400e6 + 25_569
    frame = rows.with_columns(timestamp=days.cast(pl.String) if text else days)
    with pytest.raises(DataError, match=r"days since 1899-12-30.*subtract 25569"):
        read_rows([frame], DropReport())
    seconds = rows.with_columns(timestamp=(pl.col("timestamp") - rows["timestamp"].min()).dt.total_seconds() + 30_000)
    assert len(read_rows([seconds], DropReport())) == len(rows), "seconds of a simulator"


def test_a_rate_that_no_unit_explains_is_told_and_not_refused(rows: pl.DataFrame) -> None:
    """Rows of several aircraft under one address make such rates; flights that are named are separated."""
    with pytest.warns(DescentflowWarning, match="vertical_rate contradicts .* different icao24"):
        check_units(times("vertical_rate", 0.3)(rows), "rows")
    number = pl.int_range(pl.len()).over("flight_id")
    together = rows.rename({"icao24": "flight_id"}).with_columns(icao24=pl.lit("4ca001"))
    check_units(together.with_columns(pl.col("timestamp").first() + pl.duration(seconds=5 * number)), "rows")


@pytest.mark.parametrize("rate", [0.0, 2.0, -1700.0, -10_000.0])
def test_a_rate_that_never_changes_is_refused_as_that(rate: float, rows: pl.DataFrame) -> None:
    with pytest.raises(DataError, match=rf"vertical_rate is {rate:g} in all of [\d,]+ rows.*leave the column"):
        check_units(rows.with_columns(vertical_rate=rate), "rows")


def test_a_rate_that_is_the_same_and_true_is_no_error(rows: pl.DataFrame) -> None:
    seconds = (pl.col("timestamp") - pl.col("timestamp").first().over("icao24")).dt.total_microseconds() / 1e6
    check_units(rows.drop("Mach", "TAS").with_columns(altitude=36_000 - 20 * seconds, vertical_rate=-1200.0), "rows")


def test_rows_without_any_address_are_told_as_that(rows: pl.DataFrame) -> None:
    """No warning comes before: rows of no address are of no one aircraft, and have no rates to compare."""
    with pytest.raises(DataError, match=r"lack a value .icao24 in [\d,]+.*fill the column icao24, which is empty"):
        prepare(rows.with_columns(icao24=pl.lit(None, pl.String)))


@pytest.mark.parametrize(
    "typecode", ["BE20", *(pytest.param(name, marks=pytest.mark.slow) for name in ("PC12", "AT76", "C56X"))]
)
def test_slow_and_low_types_are_read_as_they_are(typecode: str) -> None:
    """A King Air holds Mach 0.44 at FL300, less than any jet."""
    rows = simulate(typecode, 12, 3, "london-fir-2019").rows
    for without in ((), ("Mach",), ("Mach", "TAS"), ("Mach", "TAS", "groundspeed")):
        check_units(rows.drop(without), "rows.parquet")


BY_A_HUNDRED = {
    ("altitude", 100.0): "altitude seems to be multiplied by 100",
    ("altitude", 0.01): "altitude seems to be in hundreds of feet",
    ("IAS", 100.0): "IAS seems to be multiplied by 100",
    ("IAS", 0.01): "IAS seems to be divided by 100",
    ("Mach", 100.0): "Mach seems to be in hundredths",
    ("Mach", 0.01): "Mach seems to be divided by 100",
    ("TAS", 0.01): "TAS seems to be divided by 100",
    ("groundspeed", 100.0): "groundspeed seems to be multiplied by 100",
    ("groundspeed", 0.01): "groundspeed seems to be divided by 100",
    ("vertical_rate", 0.01): "vertical_rate seems to be in hundreds of ft/min",
}


@pytest.mark.parametrize("without", [(), ("Mach",), ("TAS", "groundspeed"), ALONE])
@pytest.mark.parametrize(("name", "factor"), BY_A_HUNDRED)
def test_a_factor_of_a_hundred_is_named_and_mended(
    name: str, factor: float, without: tuple[str, ...], rows: pl.DataFrame
) -> None:
    noise = pl.Series(np.random.default_rng(0).normal(0, 1, len(rows)))
    rows = rows.with_columns(pl.col("IAS") + noise).drop(without)
    if name not in rows.columns or (name == "groundspeed" and set(without) > {"TAS"}):
        return
    with pytest.raises(DataError) as caught:
        read_rows([rows.with_columns(pl.col(name) * factor)], DropReport())
    assert caught.value.got.partition("; ")[0].partition(": 7")[0].endswith(BY_A_HUNDRED[name, factor])
    assert f"multiply the column {name} by {1 / factor:g} " in caught.value.mend


def test_a_number_that_stands_for_none_throughout_is_no_scale(rows: pl.DataFrame) -> None:
    with pytest.warns(DescentflowWarning, match=r"outside 40 to 700 and taken for missing .the most frequent: 9999"):
        read_rows([rows.with_columns(TAS=pl.lit(9999.0))], DropReport())
    with pytest.warns(DescentflowWarning, match=r"check the unit of the column .times 0.01 they would be possible"):
        read_rows([rows.with_columns(pl.col("TAS") * 100)], DropReport())
