"""Values of another column and numbers that stand for none are left out and named; what aircraft do is not."""

import numpy as np
import polars as pl
import pytest
from surveillance_toys import fleet, flight

from descentflow.core.errors import DataError
from descentflow.surveillance.read_rows import read_rows
from descentflow.surveillance.rows._placeholder_values import TAKEN_FOR_MISSING, without_placeholder_values
from descentflow.surveillance.rows.air_data import isa_tas_of_mach_kt
from descentflow.surveillance.rows.drop_report import DropReport

MEASURED = ("IAS", "Mach", "TAS", "groundspeed", "vertical_rate")


def radar(flights: int = 12, every_s: float = 4.0) -> pl.DataFrame:
    """Whole knots and steps of registers, with noise, in winds that let IAS and groundspeed cross."""
    rows, rng = fleet(flights, every_s=every_s), np.random.default_rng(0)
    aircraft = rows["icao24"].rle_id().to_numpy()
    noise_kt, noise_fpm = rng.normal(0, 1.5, len(rows)), rng.normal(0, 300, len(rows))
    tas = isa_tas_of_mach_kt(rows["Mach"].to_numpy(), rows["altitude"].to_numpy())
    wind = np.linspace(-110, 20, flights)[aircraft]
    return rows.with_columns(
        IAS=(pl.col("IAS") + pl.Series(noise_kt)).round(),
        TAS=2 * (pl.Series(tas) / 2).round(),
        groundspeed=pl.Series(tas + wind).round(),
        altitude=25 * (pl.col("altitude") / 25).round(),
        vertical_rate=64 * ((pl.col("vertical_rate") + pl.Series(noise_fpm)) / 64).round(),
    )


def some(rows: pl.DataFrame, share: float = 0.3) -> pl.Expr:
    return pl.lit(pl.Series(np.random.default_rng(1).random(len(rows)) < share))


def notes_of(rows: pl.DataFrame) -> tuple[pl.DataFrame, dict[str, int]]:
    report = DropReport()
    return without_placeholder_values(rows, "rows.parquet", report), report.notes


@pytest.mark.parametrize("every_s", [1.0, 4.0, 12.0, 30.0])
def test_rounded_noisy_rows_are_left_as_they_are(every_s: float) -> None:
    rows = radar(every_s=every_s)
    assert (rows["IAS"] == rows["groundspeed"]).sum() > 0, "they cross"
    cleaned, notes = notes_of(rows)
    assert cleaned.equals(rows)
    assert notes == {}


@pytest.mark.parametrize(("name", "other"), [("IAS", "groundspeed"), ("IAS", "TAS"), ("groundspeed", "IAS")])
def test_values_of_another_column_are_left_out_by_their_name(name: str, other: str) -> None:
    rows = radar()
    wrong = some(rows)
    cleaned, notes = notes_of(rows.with_columns(pl.when(wrong).then(other).otherwise(name).alias(name)))
    (words, number), *rest = notes.items()
    assert words == f"values of {name} that equal {other} to the digit{TAKEN_FOR_MISSING}"
    assert not rest
    expected = rows.select(pl.when(~(wrong | (pl.col(name) == pl.col(other)))).then(name).alias(name)).to_series()
    assert (cleaned[name].null_count(), number) == (expected.null_count(), expected.null_count())
    assert cleaned[name].equals(expected)
    assert cleaned.drop(name).equals(rows.drop(name))


def test_a_column_that_is_another_one_is_refused() -> None:
    with pytest.raises(DataError, match=r"rows.parquet: 648 of 648 values of IAS that equal groundspeed"):
        notes_of(radar(2).with_columns(IAS="groundspeed"))


@pytest.mark.parametrize(
    ("name", "value"),
    [("vertical_rate", -64.0), ("vertical_rate", 0.0), ("vertical_rate", -32768.0), ("IAS", 127.0), ("Mach", 0.1)],
)
@pytest.mark.parametrize("share", [0.1, 0.5])
def test_a_number_that_stands_for_none_is_left_out_and_named(name: str, value: float, share: float) -> None:
    rows = radar()
    wrong = some(rows, share)
    cleaned, notes = notes_of(rows.with_columns(pl.when(wrong).then(pl.lit(value)).otherwise(name).alias(name)))
    left_out = rows.select(((pl.col(name) == value) | wrong).sum()).item()
    assert notes == {f"values of {name} that are {value:g} among others{TAKEN_FOR_MISSING}": left_out}
    assert cleaned[name].null_count() == left_out


@pytest.mark.parametrize("name", MEASURED)
def test_spikes_of_all_kinds_are_left_to_the_cleaning(name: str) -> None:
    rows = radar()
    leap = {"Mach": 0.3, "vertical_rate": 4000.0}.get(name, 120.0)
    random = pl.Series(np.random.default_rng(2).uniform(0.7, 1.5, len(rows))) * leap
    cleaned, notes = notes_of(rows.with_columns(pl.when(some(rows, 0.05)).then(pl.col(name) + random).otherwise(name)))
    assert notes == {}
    assert cleaned[name].null_count() == 0


def test_stepped_descents_of_sparse_reports_are_none() -> None:
    """Level between two reports a minute apart: a rate of zero comes again, and altitude agrees with it."""
    rows = pl.concat(flight(f"4ca{n:03d}", every_s=1.0, start_s=3620.0 * n) for n in range(30))
    seconds = pl.int_range(pl.len()).over("icao24")
    step = (seconds // 30) % 2 == 0
    altitude = 36_000.0 - 1000.0 * (seconds // 60) - pl.when(step).then(0.0).otherwise((seconds % 30) * 1000 / 30)
    stepped = rows.with_columns(altitude=altitude, vertical_rate=pl.when(step).then(0.0).otherwise(-2000.0))
    assert notes_of(stepped.gather_every(30, 15))[1] == {}
    assert notes_of(stepped.gather_every(10, 5))[1] == {}


def test_rows_keep_their_order_and_are_read_so() -> None:
    rows = radar(6).sample(fraction=1.0, shuffle=True, seed=0)
    wrong = some(rows)
    given = rows.with_columns(pl.when(wrong).then(-64.0).otherwise("vertical_rate").alias("vertical_rate"))
    report = DropReport()
    read = read_rows([given], report)
    assert read["timestamp"].equals(given["timestamp"])
    assert report.notes == {
        f"values of vertical_rate that are -64 among others{TAKEN_FOR_MISSING}": int(
            (given["vertical_rate"] == -64).sum()
        )
    }
