"""Cleaning judged by flights of which the truth is known: what it finds, what it costs, and what bias it leaves."""

from pathlib import Path

import polars as pl
import pytest

from cleaning_truth import errors_of, fates
from descentflow.cli.entry import main
from descentflow.surveillance.prepare import Cleaning, prepare

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
