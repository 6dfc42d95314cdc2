"""Rows with thrust above idle: known by N1, thrust or fuel flow, dropped if asked for, and counted."""

from datetime import UTC, datetime, timedelta
from pathlib import Path

import numpy as np
import polars as pl
import pytest

import descentflow as df
from descentflow.cli.entry import main
from descentflow.core.errors import DataError
from descentflow.surveillance.cleaning.idle import ABOVE_IDLE, with_power
from descentflow.surveillance.cleaning.thresholds import Cleaning

IDLE_N1, POWERED_N1 = 32.0, 55.0
POWERED_FT = (18_000.0, 22_000.0)


def rows(name: str, flight: str = "a", tail: str = "a00001", powered: bool = True) -> pl.DataFrame:
    """A descent whose rate grows, with power above idle from FL220 to FL180; idle rises with altitude."""
    rate = -1_200.0 - 4.0 * np.arange(220)  # no rate that could be selected
    altitude = 36_000.0 + np.cumsum(rate) * 4 / 60
    begin = datetime(2024, 3, 1, 12, tzinfo=UTC) + timedelta(days=ord(flight))
    above = powered & (altitude > POWERED_FT[0]) & (altitude < POWERED_FT[1])
    n1 = np.where(above, POWERED_N1, IDLE_N1) + altitude / 4_000.0
    values = {"N1": n1, "thrust": 900.0 * (n1 - 25.0), "fuel_flow": 0.1 * (n1 / IDLE_N1) ** 3}
    return pl.DataFrame(
        {
            "timestamp": [begin + timedelta(seconds=4 * k) for k in range(len(altitude))],
            "flight_id": flight,
            "icao24": tail,
            "typecode": "A320",
            "altitude": altitude,
            "vertical_rate": rate,
            "IAS": 280.0,
            "Mach": 0.0,
            name: values[name],
        }
    ).with_columns(Mach=pl.lit(None, pl.Float64))


def two(name: str) -> pl.DataFrame:
    """A flight with thrust, and one of the same aircraft without."""
    return pl.concat([rows(name), rows(name, "b", powered=False)])


@pytest.mark.parametrize("name", ["N1", "thrust", "fuel_flow"])
def test_levels_above_idle_are_left_out_and_counted(name: str) -> None:
    plain = df.prepare(two(name))
    prepared = df.prepare(two(name), cleaning=Cleaning(idle_only=5.0))
    powered = (pl.col("level_fl") * 100).is_between(*POWERED_FT, closed="none") & (pl.col("flight_id") == "a")
    step = next(each for each in prepared.report.steps if each.step == "above_idle")
    flown = two(name).filter((pl.col("flight_id") == "a") & pl.col("altitude").is_between(*POWERED_FT, closed="none"))
    assert step.rows_dropped == len(flown)
    assert len(plain.frame.filter(powered)) == 39
    assert prepared.frame.filter(powered).is_empty()
    # Nothing else goes but the levels between the last row at idle and the first above it.
    assert len(plain.frame) - len(prepared.frame) <= 39 + 2 * 2
    assert prepared.cleaning is not None
    assert prepared.cleaning.idle_only == 5.0


def test_idle_is_that_of_the_aircraft_and_the_band() -> None:
    other = rows("N1", "c", tail="b00002", powered=False).with_columns(pl.col("N1") + 10.0)
    powered = with_power(pl.concat([two("N1"), other]), 500.0)
    above = powered.filter(pl.col("flight_id") != "a")[ABOVE_IDLE]
    assert above.min() > -1.0  # type: ignore[operator]
    assert above.max() < 1.5  # type: ignore[operator]


def test_rows_that_do_not_tell_are_dropped_and_rows_without_a_column_refused() -> None:
    some = two("N1").with_columns(pl.when(pl.col("altitude") > 30_000).then("N1"))
    prepared = df.prepare(some, cleaning=Cleaning(idle_only=5.0))
    assert prepared.frame["level_fl"].min() >= 300  # type: ignore[operator]
    with pytest.raises(DataError, match=r"no column that tells thrust above idle.*--column N1="):
        df.prepare(two("N1").drop("N1"), cleaning=Cleaning(idle_only=5.0))


def test_the_command_and_a_column_of_another_name(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    two("N1").rename({"N1": "fan"}).write_parquet(tmp_path / "rows.parquet")
    words = ["prepare", str(tmp_path / "rows.parquet"), "--column", "N1=fan", "--idle-only"]
    assert main([*words, "--out", str(tmp_path / "idle.parquet")]) == 0
    assert "above_idle" in capsys.readouterr().out
    held = df.prepare(two("N1"), cleaning={"idle_only": 5.0}).frame
    written = pl.read_parquet(tmp_path / "idle.parquet")
    assert written.drop("timestamp").equals(held.drop("timestamp"))
    assert written["N1"].count() == len(written)


@pytest.mark.parametrize(
    ("file", "bottom_fl", "levels", "share"),
    [("rj85_recorder_2001", 60, 581, 0.48), ("b763_recorder", 100, 2522, 0.33)],
)
def test_free_descents_of_recorders_are_mostly_not_idle(
    shared: Path, file: str, bottom_fl: int, levels: int, share: float
) -> None:
    """Counted apart from this code first, from the same files."""
    from recorder_thrust import above_of_levels, recorder_rows

    rules = Cleaning(bottom_fl=bottom_fl)
    own = recorder_rows(shared / "real" / f"{file}.parquet")
    above = above_of_levels(df.prepare(own, cleaning=rules).frame, own, rules)
    assert len(above) == pytest.approx(levels, rel=0.02)
    assert float((above[ABOVE_IDLE] <= 5).mean()) == pytest.approx(share, abs=0.02)  # type: ignore[arg-type]
