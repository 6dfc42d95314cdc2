"""Any descent on levels lies on the path through its rows; any rows are accounted for."""

import numpy as np
import polars as pl
from hypothesis import given, settings
from hypothesis import strategies as st
from surveillance_toys import START, rows_at

from descentflow.surveillance.cleaning._level_grid import to_levels
from descentflow.surveillance.cleaning.rates import ConstantRate
from descentflow.surveillance.cleaning.thresholds import Cleaning
from descentflow.surveillance.rows.drop_report import DropReport

# Steps of a descent: seconds and feet in the 25 ft of a transponder (whole levels come up often) or anything at all.
STEPS = st.lists(
    st.tuples(st.floats(0.5, 90.0), st.one_of(st.integers(1, 160).map(lambda k: 25.0 * k), st.floats(0.01, 4000.0))),
    min_size=1,
    max_size=40,
)


@settings(max_examples=150, deadline=None)
@given(steps=STEPS, top=st.integers(800, 1600).map(lambda k: 25.0 * k), bottom_fl=st.integers(0, 200))
def test_levels_lie_on_the_path_once_each(steps: list[tuple[float, float]], top: float, bottom_fl: int) -> None:
    time = np.concatenate([[0.0], np.cumsum([s for s, _ in steps])]).round(6)
    height = top - np.concatenate([[0.0], np.cumsum([f for _, f in steps])])
    rows = rows_at(time.tolist(), altitude=height.tolist(), IAS=(250 + np.sin(time)).tolist())
    levels = to_levels(rows, Cleaning(bottom_fl=bottom_fl, slowest_fpm=0.0), DropReport())
    level = levels["level_fl"].to_numpy()
    assert (np.diff(level) < 0).all(), "sorted downwards, no level twice"
    assert (level >= bottom_fl).all()
    at = levels["timestamp"].dt.epoch("us").to_numpy() / 1e6 - START.timestamp()
    # 1e-6 ft of 100 ft and a microsecond of rounding, at up to 4000 ft / 0.5 s.
    np.testing.assert_allclose(np.interp(at, time, height), level * 100.0, atol=1e-6 + 8000 * 2e-6)
    expected = np.interp(-level * 100.0, -height, 250 + np.sin(time))
    np.testing.assert_allclose(levels["IAS"].to_numpy(), expected, rtol=1e-9)
    # Every level within a bridged step is there: those of the closed interval, above the bottom.
    wanted = {
        fl
        for i in range(len(steps))
        if time[i + 1] - time[i] <= 60 and height[i] - height[i + 1] <= 3000
        for fl in range(int(np.ceil(height[i + 1] / 100)), int(np.floor(height[i] / 100)) + 1)
        if fl >= bottom_fl
    }
    # A gap of exactly the limit may fall on either side by rounding.
    assert set(level.tolist()) == wanted or any(abs(s - 60) < 1e-5 or abs(f - 3000) < 1e-5 for s, f in steps)


@settings(max_examples=60, deadline=None)
@given(
    rates=st.lists(st.integers(-40, -16).map(lambda k: 64.0 * k), min_size=2, max_size=80),
    every_s=st.floats(1.0, 12.0),
    cut=st.integers(1, 79),
)
def test_managed_stretches_of_a_flight_do_not_depend_on_other_flights(
    rates: list[float], every_s: float, cut: int
) -> None:
    def flown(name: str, rates: list[float]) -> pl.DataFrame:
        times, air = [every_s * i for i in range(len(rates))], {"Mach": 0.7, "altitude": 20_000.0}
        return rows_at(times, name, vertical_rate=rates).with_columns(**{k: pl.lit(v) for k, v in air.items()})

    rows, other = flown("a", rates), flown("b", [-1000.0] * 90).head(cut)
    alone = ConstantRate().keep(rows)
    both = ConstantRate().keep(pl.concat([rows, other]))
    assert both.filter(flight_id="a").equals(alone)
