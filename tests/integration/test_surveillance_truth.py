"""Cleaning judged by flights of which the truth is known, and the page of plots that shows every rule at work."""

import json
from pathlib import Path

import polars as pl
import pytest
from polars.testing import assert_frame_equal
from surveillance_toys import fleet, written

from cleaning_truth import errors_of, fates
from descentflow.cli.entry import main
from descentflow.core.errors import ConfigError
from descentflow.surveillance.prepare import Cleaning, prepare
from descentflow.surveillance.rows.drop_report import SHOWN_COLUMNS as SHOWN
from descentflow.surveillance.rows.drop_report import some_flights

FLIGHTS = 200


@pytest.fixture(scope="module")
def world(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, pl.DataFrame]:
    """File of rows, and the truth behind them."""
    out = tmp_path_factory.mktemp("world") / "rows.parquet"
    assert main(["simulate", "--typecode", "A320", "--flights", str(FLIGHTS), "--seed", "11", "--out", str(out)]) == 0
    return out, pl.read_parquet(out.with_name("rows_truth.parquet")).sort("timestamp")


@pytest.mark.parametrize("rate", ["reported", "differenced"])
def test_level_offs_and_held_rates_go_and_idle_descent_stays(rate: str, world: tuple[Path, pl.DataFrame]) -> None:
    rows = pl.read_parquet(world[0])
    fate = fates(rows if rate == "reported" else rows.drop("vertical_rate"), world[1])

    def share(label: str, *reasons: str) -> float:
        of = fate.filter(label=label)["reason"]
        return float(of.is_in(reasons).fill_null(False).mean() if reasons else of.is_not_null().mean())

    assert len(fate.filter(label="level_off")) > 200
    assert share("level_off") > 0.99
    level = fate.filter(reason="not_descending")["label"]
    assert level.is_in(["level_off", "transient"]).mean() > 0.99  # level flight, or on the way into and out of it
    assert len(fate.filter(label="constant_rate")) > 200
    held = share("constant_rate", "constant_rate")
    lost = share("idle", "constant_rate")
    taken = fate.filter(reason="constant_rate")["label"]
    precision = float((taken == "constant_rate").mean())
    # Measured on 1,500 flights: 0.78 and 0.001 (0.77 and 0.002 with rates from altitude), and of what is taken 0.78
    # (0.76) is held: held rates are 2 % of the rows. Few flights scatter.
    assert precision > 0.3
    assert held > 0.6
    assert lost < 0.03
    # Besides held rates, only rows of a repeated altitude go.
    assert share("idle", "not_descending", "transient", "second_descent") < 0.01


def test_levels_lie_where_the_aircraft_was(world: tuple[Path, pl.DataFrame]) -> None:
    descents = prepare([world[0]], cleaning=Cleaning(bottom_fl=100)).frame
    errors = pl.concat(
        errors_of(levels, world[1].filter(flight_id=levels["flight_id"][0]))
        for levels in descents.partition_by("flight_id")
    )
    assert len(errors) > 100 * FLIGHTS
    mean, spread = (errors.select(statistic(pl.all())).row(0, named=True) for statistic in (pl.Expr.mean, pl.Expr.std))
    # Bias: a tenth of what is read from a table (1 s, 1 kt, 32 ft/min). Spread: that of one report.
    assert abs(mean["time_s"]) < 0.1
    assert abs(mean["cas_kt"]) < 0.1
    assert abs(mean["rate_fpm"]) < 10
    assert spread["time_s"] < 0.5
    assert spread["cas_kt"] < 1.0
    assert spread["rate_fpm"] < 80


@pytest.fixture(scope="module")
def path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    at = pl.int_range(pl.len())
    rows = fleet(6).with_columns(
        altitude=pl.when(at % 397 == 50).then(pl.col("altitude") + 4000).otherwise("altitude"),
        Mach=pl.when(at % 101 == 7).then(pl.col("Mach") * 0.8).otherwise("Mach"),
    )
    return written(rows, tmp_path_factory.mktemp("rows") / "rows.parquet")


def test_dropped_rows_account_for_every_row_and_do_not_depend_on_partitions(path: Path, tmp_path: Path) -> None:
    whole = prepare([path], shown=100, out=tmp_path / "a.parquet")
    assert whole.dropped_rows is not None
    assert whole.dropped_rows.columns == [*SHOWN, "reason"]
    counts = dict(whole.dropped_rows["reason"].value_counts().iter_rows())
    after = whole.report.steps[[step.step for step in whole.report.steps].index("flights_separated") :]
    assert {step.step: step.rows_dropped for step in after if step.rows_dropped} == {
        k: v for k, v in counts.items() if k
    }
    assert counts[None] == after[-1].rows_left
    few = [
        prepare([path], shown=2, out=tmp_path / f"{memory}.parquet", memory_bytes=memory, workers=2)
        for memory in (10**9, 500_000)
    ]
    frames = [
        prepared.dropped_rows.sort("flight_id", "timestamp") for prepared in few if prepared.dropped_rows is not None
    ]
    assert_frame_equal(*frames)
    assert_frame_equal(frames[0], some_flights(whole.dropped_rows, 2).sort("flight_id", "timestamp"))
    assert frames[0]["flight_id"].n_unique() < whole.dropped_rows["flight_id"].n_unique()


def test_a_page_is_written_whole_and_names_every_rule(path: Path, tmp_path: Path) -> None:
    folder, report = tmp_path / "figures", tmp_path / "r.json"
    words = ["prepare", str(path), "--out", str(tmp_path / "s"), "--figures", str(folder), "--report", str(report)]
    assert main(words) == 0
    page = (folder / "index.html").read_text()
    pictures = sorted(p.name for p in folder.iterdir() if p.suffix == ".png")
    assert pictures
    assert all(f'src="{name}"' in page for name in pictures)
    assert all((folder / name).read_bytes().startswith(b"\x89PNG") for name in pictures)
    assert {p.name for p in folder.iterdir()} == {"index.html", *pictures}
    for step in json.loads(report.read_text())["report"]["steps"]:
        if step["rows_dropped"] and step["flights_left"] is not None:
            assert step["step"].replace("_", " ") in page
    # The store is finished: there is nothing left to be shown.
    assert main(words) == 2
    with pytest.raises(ConfigError, match="shown while they are cleaned"):
        prepare([path], shown=1, out=tmp_path / "s")
