"""Scripts that fly other simulators: plans from real flights, and reports of what was flown."""

from datetime import UTC, datetime

import numpy as np
import polars as pl
import pytest

from flying.flight_plans import FlightPlan, cas_of_mach_kt, flight_plans
from flying.radar_reports import reports, table

START = datetime(2024, 3, 1, 10, tzinfo=UTC)


def descent(mach: float = 0.78, cas_kt: float = 290.0, name: str = "a1") -> pl.DataFrame:
    """Prepared descent from FL360 to FL110 at Mach, then CAS, 4 s a level."""
    levels = np.arange(360, 109, -1)
    cas = np.minimum([cas_of_mach_kt(mach, float(level)) for level in levels], cas_kt)
    n = len(levels)
    return pl.DataFrame(
        {
            "flight_id": [name] * n,
            "icao24": [name] * n,
            "typecode": ["A320"] * n,
            "level_fl": levels,
            "timestamp": [START.replace(minute=i * 4 // 60, second=i * 4 % 60) for i in range(n)],
            "IAS": cas,
            "Mach": np.where(cas < cas_kt, mach, np.nan),
            "vertical_rate": np.full(n, -1500.0),
            "TAS": pl.Series([None] * n, dtype=pl.Float64),
        }
    )


def test_plan_holds_the_schedule_that_was_flown() -> None:
    """The crossover of M 0.78 and 290 kt lies at FL313, so both speeds are seen as they are."""
    plan = flight_plans(descent(), None, 150.0)[0]
    assert (plan.top_fl, plan.bottom_fl, plan.intervals_s) == (360.0, 150.0, (4.0,))
    assert plan.mach == pytest.approx(0.78)
    assert plan.cas_kt == pytest.approx(290.0)
    assert plan.channels == ("vertical_rate", "Mach")  # a channel without a value is not reported


def test_rows_say_how_often_and_whether_a_rate_was_reported() -> None:
    seconds = [0, 7, 7, 20, 400, 412]
    rows = pl.DataFrame(
        {
            "icao24": ["a1"] * 6 + ["b2"],
            "timestamp": [START.replace(minute=s // 60, second=s % 60) for s in [*seconds, 3]],
            "vertical_rate": pl.Series([None] * 7, dtype=pl.Float64),
        }
    )
    plan = flight_plans(descent(), rows, 100.0)[0]
    assert plan.intervals_s == (7.0, 13.0, 12.0)  # neither the repeated report nor the loss of 380 s
    assert "vertical_rate" not in plan.channels  # `prepare` had differenced it


def test_reports_are_sampled_at_the_intervals_and_quantised() -> None:
    plan = FlightPlan("f", "a1", "A320", START, 360, 100, 0.78, 290, (4.0, 9.0), ("vertical_rate", "track", "Mach"))
    time = np.arange(0.0, 41.0)
    state = {
        "time_s": time,
        "altitude": 36000.0 - 30.0 * time,
        "IAS": 250.0 + 0.1 * time,
        "vertical_rate": np.full(41, -1807.0),
        "track": (359.0 + 0.1 * time) % 360,  # through north
        "latitude": 0.001 * time,
        "longitude": 0.0 * time,
    }
    rows = reports(plan, state, number=2)
    seconds = [(stamp - START).total_seconds() - 2 * 86400 for stamp in rows["timestamp"]]
    assert seconds == [0, 4, 13, 17, 26, 30, 39]
    assert rows["altitude"].to_list() == [25 * round((36000 - 30 * s) / 25) for s in seconds]
    assert set(rows["vertical_rate"]) == {-1792.0}  # 56 steps of 32 ft/min
    assert all(t > 358 or t < 3.1 for t in rows["track"])
    assert "Mach" not in rows.columns  # the state has none
    assert table([rows, rows.drop("track")]).height == 14
