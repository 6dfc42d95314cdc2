"""Sampling, scores and predictions of a fit, run as a user runs them."""

from datetime import UTC, datetime
from hashlib import sha256
from pathlib import Path

import numpy as np
import polars as pl
import pytest
import torch
from bada4_dummies import dummies
from command_line_toys import fit
from pyproj import Geod
from scipy.io import netcdf_file

import descentflow as df
from descentflow.aircraft_types.registry import aircraft
from descentflow.cli.entry import main
from descentflow.densities.checkpoint import load_model
from descentflow.representation.read_checkpoint import read_checkpoint

pytestmark = pytest.mark.usefixtures("plain_figures")


def test_sample_table(run: Path, tmp_path: Path) -> None:
    checkpoint = str(run / "checkpoints" / "best.ckpt")
    for name in ("a.parquet", "b.parquet"):
        assert main(["sample", checkpoint, "-n", "50", "--seed", "3", "--out", str(tmp_path / name)]) == 0
    first, second = pl.read_parquet(tmp_path / "a.parquet"), pl.read_parquet(tmp_path / "b.parquet")
    assert first.equals(second), "the same seed gives the same samples, bit for bit"
    assert first.columns == [
        "sample_id", "level_fl", "time_s", "altitude_ft", "CAS", "Mach", "TAS", "vertical_rate", "drag_n",
        "thrust_n", "fuel_flow_kg_s", "fuel_kg", "co2_kg",
        "distance_nm", "distance_to_go_nm", "top_of_descent_nm", "groundspeed",
    ]  # fmt: skip
    assert first["sample_id"].n_unique() == 50
    assert (first["vertical_rate"] < 0).all()
    assert (first["altitude_ft"] == 100 * first["level_fl"]).all()
    steps = first.with_columns(pl.col("time_s").diff().over("sample_id").alias("step"))["step"].drop_nulls()
    assert (steps > 0).all(), "time grows down each sample's rows"
    # The average rate of each interval explains its time: units and signs agree.
    sample = first.filter(sample_id=0)
    height = -np.diff(sample["altitude_ft"].to_numpy())
    mean_slowness = -(0.5 / sample["vertical_rate"].to_numpy()[1:] + 0.5 / sample["vertical_rate"].to_numpy()[:-1])
    np.testing.assert_allclose(np.diff(sample["time_s"].to_numpy()), 60 * height * mean_slowness, rtol=0.02)


def test_samples_are_laid_over_the_ground(run: Path, tmp_path: Path, capsys) -> None:
    words = ["sample", str(run / "checkpoints" / "best.ckpt"), "-n", "20"]
    where = ["--end", "33.95S,151.18E", "--track", "155", "--to-go", "40", "--wind", "150:300/20,350:280/70"]
    when = ["--time", "2026-11-22T10:00:00"]
    assert main([*words, *where, *when, "--out", str(tmp_path / "placed.parquet")]) == 0
    assert main([*words, "--out", str(tmp_path / "still.parquet")]) == 0
    placed, still = pl.read_parquet(tmp_path / "placed.parquet"), pl.read_parquet(tmp_path / "still.parquet")
    assert placed.columns == [*still.columns, "latitude", "longitude", "track", "timestamp"]
    lowest = placed.filter(level_fl=150)
    assert lowest["distance_to_go_nm"].to_numpy() == pytest.approx(40.0)
    assert lowest["timestamp"].unique().to_list() == [datetime(2026, 11, 22, 10, tzinfo=UTC)]
    _, _, metres = Geod(ellps="WGS84").inv(
        placed["longitude"], placed["latitude"], [151.18] * len(placed), [-33.95] * len(placed)
    )
    np.testing.assert_allclose(np.array(metres) / 1852, placed["distance_to_go_nm"], atol=1e-6)
    # 280 and 300 degrees are behind a flight on track 155 by 55 and 35 degrees: a tailwind, more of it higher up.
    gained = (placed["groundspeed"] - still["groundspeed"]).to_numpy()
    assert gained.min() > 10
    assert gained.max() < 70
    assert main([*words, "--end", "51,4", "--out", str(tmp_path / "s.csv")]) == 2
    assert "an end point without a track" in capsys.readouterr().err
    route = ["--route", "52.5,3.0", "52.2,4.0", "52.3,4.76"]
    assert main([*words, *route, "--out", str(tmp_path / "route.csv")]) == 0
    assert pl.read_csv(tmp_path / "route.csv")["track"].n_unique() > 2


def test_the_bands_of_a_figure_are_the_quantiles_of_the_table(run: Path) -> None:
    samples = df.sample(run / "checkpoints" / "best.ckpt", 200, seed=4)
    figure = samples.figure()
    levels = samples.to_polars().filter(pl.len().over("level_fl") >= 20)
    bottom = levels.filter(level_fl=150).select("sample_id", bottom_s="time_s")
    levels = levels.join(bottom, on="sample_id").with_columns(left=(pl.col("bottom_s") - pl.col("time_s")) / 60)
    for ax, column in zip(figure.axes, ("CAS", "vertical_rate", "left"), strict=True):
        quantiles = levels.group_by("level_fl").agg(
            *(pl.col(column).quantile(q, "linear").alias(str(q)) for q in (0.05, 0.5, 0.95))
        ).sort("level_fl")  # fmt: skip
        (median,) = [line for line in ax.lines if line.get_label() == "median"]
        np.testing.assert_allclose(median.get_xdata(), quantiles["0.5"], rtol=1e-9, atol=1e-9)
        np.testing.assert_array_equal(median.get_ydata(), quantiles["level_fl"])
        corners = ax.collections[0].get_paths()[0].vertices
        low = [corners[corners[:, 1] == level, 0].min() for level in quantiles["level_fl"]]
        high = [corners[corners[:, 1] == level, 0].max() for level in quantiles["level_fl"]]
        np.testing.assert_allclose(low, quantiles["0.05"], rtol=1e-9, atol=1e-9)
        np.testing.assert_allclose(high, quantiles["0.95"], rtol=1e-9, atol=1e-9)


def test_netcdf_and_csv_hold_the_same_samples(run: Path, tmp_path: Path) -> None:
    checkpoint = str(run / "checkpoints" / "best.ckpt")
    for name in ("s.nc", "s.csv", "s.parquet"):
        assert main(["sample", checkpoint, "-n", "7", "--out", str(tmp_path / name)]) == 0
    table = pl.read_parquet(tmp_path / "s.parquet")
    assert pl.read_csv(tmp_path / "s.csv").shape == table.shape
    with netcdf_file(tmp_path / "s.nc", "r", mmap=False) as file:
        cas, levels = file.variables["CAS"][:], file.variables["level_fl"][:]
        assert file.variables["CAS"].units == b"kt"
    assert np.isfinite(cas).sum() == len(table)
    row = table.filter(sample_id=2)
    np.testing.assert_allclose(cas[2][np.isin(levels, row["level_fl"])][::-1], row["CAS"])


def test_files_of_samples_say_where_they_come_from(run: Path, tmp_path: Path) -> None:
    xarray = pytest.importorskip("xarray")
    checkpoint = run / "checkpoints" / "best.ckpt"
    for name in ("s.nc", "s.parquet"):
        assert main(["sample", str(checkpoint), "-n", "7", "--seed", "3", "--out", str(tmp_path / name)]) == 0
    expected = {
        "source": f"descentflow {df.__version__}, torch {torch.__version__}",
        "model": "GaussianDensity",
        "typecode": "A320",
        "seed": "3",
        "checkpoint": "best.ckpt",
        "checkpoint_sha256": sha256(checkpoint.read_bytes()).hexdigest(),
    }
    parquet = pl.read_parquet_metadata(tmp_path / "s.parquet")
    with xarray.open_dataset(tmp_path / "s.nc") as data:
        assert data["CAS"].coords["level_fl"].values.tolist() == list(range(150, int(data["level_fl"].max()) + 1))
        for attributes in (parquet, data.attrs, df.sample(checkpoint, 1, seed=3).to_xarray().attrs):
            assert expected.items() <= attributes.items()
            made = datetime.fromisoformat(attributes["date_created"])
            assert abs((datetime.now(UTC) - made).total_seconds()) < 600


def test_predict_descent_writes_intervals(run: Path, descents: Path, tmp_path: Path, capsys) -> None:
    words = ["predict-descent", str(run / "checkpoints" / "best.ckpt"), str(descents), "--from-fl", "290", "-n", "60"]
    assert main([*words, "--out", str(tmp_path / "p.parquet")]) == 0
    said = capsys.readouterr().out
    assert "times calibrated on 211 flights of the fit" in said
    assert "90 % intervals hold" in said
    table = pl.read_parquet(tmp_path / "p.parquet")
    assert (table["q05_s"] <= table["q95_s"]).all()
    placed = ["--end", "52.3,4.76", "--track", "180", "--continuations", str(tmp_path / "all.csv")]
    assert main([*words, *placed, "--out", str(tmp_path / "p.csv")]) == 0
    intervals, every = pl.read_csv(tmp_path / "p.csv"), pl.read_csv(tmp_path / "all.csv")
    assert intervals.columns[-6:] == [
        "distance_to_go_nm", "top_of_descent_nm", "groundspeed", "latitude", "longitude", "track",
    ]  # fmt: skip
    assert every.columns[:3] == ["flight_id", "sample_id", "level_fl"]
    medians = every.group_by("flight_id", "level_fl").agg(pl.col("distance_nm").median())
    both = intervals.join(medians, on=["flight_id", "level_fl"])
    np.testing.assert_allclose(both["q50_nm"], both["distance_nm"], atol=1e-9)
    assert main([*words, "--flight", "nobody", "--out", str(tmp_path / "p.parquet")]) == 2
    assert "was not trained or validated on" in capsys.readouterr().err


def test_a_conditional_model_from_fit_to_samples(tmp_path: Path, descents: Path, capsys) -> None:
    """Every command with a context: fitted, scored, evaluated on each flight's own, sampled with what is given."""
    flights = pl.read_parquet(descents)["flight_id"].unique().sort()
    speeds = pl.Series([("SLO", "FST", "MID")[i % 3] for i in range(len(flights))])
    table = pl.DataFrame({"flight_id": flights, "operator": speeds, "deviation_k": np.arange(len(flights)) % 7.0})
    table.write_csv(tmp_path / "context.csv")
    context = ["--data.context=[operator,deviation_k,entry_fl]", f"--data.context_table={tmp_path / 'context.csv'}"]
    folder = fit(tmp_path, descents, "gaussian", *context, "--final=false")
    checkpoint = str(folder / "checkpoints" / "best.ckpt")
    where = f"--trainer.logger.init_args.save_dir={tmp_path / 'tested'}"
    assert main(["predict", "--ckpt_path", checkpoint, where]) == 0
    known = ["--context-table", str(tmp_path / "context.csv")]
    words = ["evaluate", checkpoint, "--real", str(descents), "--out", str(tmp_path / "e"), "-n", "100"]
    assert main([*words, *known]) == 0
    assert main(words) == 2, "the table is missing"
    out = tmp_path / "s.parquet"
    given = ["--given", "operator=FST", "deviation_k=3.5", "entry_fl=300"]
    assert main(["sample", checkpoint, "-n", "30", *given, "--out", str(out)]) == 0
    samples = pl.read_parquet(out)
    assert samples["given_operator"].unique().to_list() == ["FST"]
    assert samples.group_by("sample_id").agg(pl.col("level_fl").max())["level_fl"].unique().to_list() == [300]
    rows = pl.DataFrame({"operator": ["SLO", "FST"], "deviation_k": [0.0, 5.0], "entry_fl": [280, 340]})
    rows.write_csv(tmp_path / "rows.csv")
    for name in ("t.parquet", "t.nc"):
        words = ["sample", checkpoint, "-n", "5", "--given-table", str(tmp_path / "rows.csv")]
        assert main([*words, "--out", str(tmp_path / name)]) == 0
    first = pl.read_parquet(tmp_path / "t.parquet").unique("sample_id", keep="first").sort("sample_id")
    assert first["given_operator"].to_list() == ["SLO", "FST", "SLO", "FST", "SLO"]
    held_out = read_checkpoint(checkpoint)["descentflow"]["representation"]["split"]["test"]
    reaching = pl.read_parquet(descents).filter(pl.col("flight_id").is_in(held_out), pl.col("level_fl") > 320)
    words = ["predict-descent", checkpoint, str(descents), "--from-fl", "290", "-n", "60", *known]
    words += ["--flight", reaching["flight_id"][0]]
    assert main([*words, "--out", str(tmp_path / "p.parquet")]) == 0
    capsys.readouterr()
    for bad, message in (([], "a conditional model without a context"), (["--given", "operator"], "NAME=VALUE")):
        assert main(["sample", checkpoint, "-n", "3", *bad, "--out", str(out)]) == 2
        assert message in capsys.readouterr().err


@pytest.mark.parametrize(
    ("family", "name"), [pytest.param("BADA3", "J2H", marks=pytest.mark.slow), ("BADA4", "Dummy-TWIN")]
)
def test_a_licence_holders_directory_serves_the_whole_path(tmp_path: Path, family: str, name: str) -> None:
    """EUROCONTROL's files as they come (here the dummies, from the folder above): all commands fly that type."""
    release = dummies().parent if family == "BADA4" else dummies(family)
    rows, prepared, bada = tmp_path / "rows.parquet", tmp_path / "descents.parquet", ["--bada-dir", str(release)]
    assert main(["simulate", "--typecode", name, *bada, "--flights", "80", "--out", str(rows)]) == 0
    assert main(["prepare", str(rows), "--out", str(prepared)]) == 0
    own = ["--data.bada_dir", str(release), "--data.aircraft", name, "--final=false"]
    run = fit(tmp_path / "run", prepared, "gaussian", *own)
    checkpoint = str(next(run.rglob("best.ckpt")))
    assert load_model(checkpoint).representation.decoder.aircraft == aircraft(name, release)
    out = ["--out", str(tmp_path / "made.parquet")]
    assert main(["sample", checkpoint, "-n", "5", *out]) == 0
    assert main(["predict-descent", checkpoint, str(prepared), "--from-fl", "250", "-n", "50", *out]) == 0
    assert main(["export", checkpoint, "--to", "parquet", "-n", "5", *out]) == 0
    scores = ["--no-figures", "--out", str(tmp_path / "scores")]
    assert main(["evaluate", checkpoint, "--real", str(prepared), *scores]) == 0
    assert main(["diagnose", "--real", str(prepared), "--typecode", name, *bada, "--out", str(tmp_path / "gap")]) == 0
