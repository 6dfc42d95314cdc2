"""Times between levels: of the simulator's own flights no difference, of longer ones the difference that was made."""

import json
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import polars as pl
import pytest
from html_toys import Elements
from point_toys import write_so6
from scipy.stats import kstest

import descentflow as df
from descentflow.cli.entry import main
from descentflow.diagnosis.level_times.leg_statistics import p_values

pytestmark = pytest.mark.usefixtures("components_once", "worlds_once")


@pytest.fixture(scope="module")
def flown(a320: Path) -> pl.DataFrame:
    """Samples as flights with timestamps."""
    start = datetime(2026, 3, 1, 10, tzinfo=UTC)
    table = df.sample(a320, 300, seed=5).to_polars()
    return table.select(
        pl.col("sample_id").cast(pl.String).alias("flight_id"),
        "level_fl",
        (pl.lit(start) + pl.duration(milliseconds=(pl.col("time_s") * 1000).cast(pl.Int64))).alias("timestamp"),
        "time_s",
    )


def stretched(frame: pl.DataFrame, by: float) -> pl.DataFrame:
    more = (pl.col("time_s") * 1e6 * by).cast(pl.Int64)
    return frame.with_columns(timestamp=pl.col("timestamp").first() + pl.duration(microseconds=more))


def test_the_models_own_samples_take_its_times(a320: Path, flown: pl.DataFrame, tmp_path: Path, capsys) -> None:
    real = write_so6(flown, tmp_path / "own.so6")
    assert main(["evaluate", str(a320), "--real", str(real), "-n", "1000", "--out", str(tmp_path / "out")]) == 0
    said = capsys.readouterr().out
    assert "cannot be told from a320.ckpt" in said
    found = pl.read_csv(tmp_path / "out" / "level_times.csv")
    # Whole seconds at both ends of a leg: an error of 0.4 s for one flight, of nothing for the mean of hundreds.
    own = flown.filter(pl.col("level_fl").is_in([200, 250])).sort("level_fl").group_by("flight_id")
    legs = own.agg(pl.len(), seconds=pl.col("time_s").max() - pl.col("time_s").min()).filter(len=2)
    row = found.row(by_predicate=pl.col("leg") == "FL250 to FL200", named=True)
    assert row["mean_real_s"] == pytest.approx(legs["seconds"].mean(), abs=0.1)
    assert row["n_real"] == len(legs)


def test_longer_times_are_a_difference_that_no_cause_is_named_for(
    a320: Path, flown: pl.DataFrame, tmp_path: Path, capsys
) -> None:
    real = write_so6(stretched(flown, 1.08), tmp_path / "longer.so6")
    out = tmp_path / "gap"
    assert main(["diagnose", "--real", str(real), "--simulator", str(a320), "--out", str(out)]) == 0
    said = capsys.readouterr().out
    assert "take other times than a320.ckpt" in said
    assert "These flights lack:" in said
    assert "times alone do not tell them apart: temperature" in said
    found = json.loads((out / "level_times.json").read_text())
    for leg in found["legs"]:
        made = 0.08 * leg["mean_simulated_s"]
        assert leg["low_s"] - 2 < made < leg["high_s"] + 2
    assert "vertical rate lag" not in found["cannot_be_told_apart"]
    page = (out / "level_times.html").read_text()
    parser = Elements()
    parser.feed(page)
    assert parser.open == []
    assert "<script" not in page


def test_a_type_and_prepared_flights_are_simulators_too(flown: pl.DataFrame, tmp_path: Path, capsys) -> None:
    real = write_so6(flown, tmp_path / "real.so6")
    assert main(["diagnose", "--real", str(real), "--typecode", "A320", "--out", str(tmp_path / "nominal")]) == 0
    found = json.loads((tmp_path / "nominal" / "level_times.json").read_text())
    assert {leg["n_simulated"] for leg in found["legs"]} == {1}
    df.prepare(df.simulate("A320", 60, seed=3).rows, out=tmp_path / "simulated.parquet")
    words = ["diagnose", "--real", str(real), "--simulator", str(tmp_path / "simulated.parquet")]
    assert main([*words, "--out", str(tmp_path / "flights")]) == 0
    assert "simulated.parquet" in capsys.readouterr().out


def test_options_that_need_airspeeds_are_refused(a320: Path, flown: pl.DataFrame, tmp_path: Path, capsys) -> None:
    real = str(write_so6(flown, tmp_path / "real.so6"))
    words = ["diagnose", "--real", real, "--simulator", str(a320), "--out", str(tmp_path / "out")]
    assert main([*words, "--channels", "IAS"]) == 2
    assert "--channels with points" in capsys.readouterr().err
    assert main(["diagnose", "--real", real, "--out", str(tmp_path / "out")]) == 2
    assert "no --simulator" in capsys.readouterr().err


def test_p_values_are_uniform_where_there_is_no_difference() -> None:
    """The seed is fixed; of all seeds one in a thousand would fail."""
    rng = np.random.default_rng(11)
    least = []
    for seed in range(200):
        # A flight that is slow on one leg is slow on the other, and a fifth of the legs were not seen.
        both = rng.normal(160, 10, (90, 1)) + rng.normal(0, 5, (90, 3))
        both[rng.random((90, 3)) < 0.2] = np.nan
        least.append(p_values(both[:30], both[30:], seed, n=99).min())
    # Labellings give multiples of 0.01; spread over each, so that a continuous test applies.
    spread = np.array(least) - rng.random(200) * 0.01
    assert kstest(spread, "uniform").pvalue > 0.001
