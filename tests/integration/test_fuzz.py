"""Damaged inputs by a fixed seed, and the smallest forms of what the harness found."""

import json
import os
import subprocess
import sys
from pathlib import Path

import polars as pl
import pytest
import torch
from refusals import refuses

from descentflow.core.errors import CheckpointError, ConfigError, DataError, SamplingError
from descentflow.densities.checkpoint import load_model
from descentflow.densities.mixture_parameters import Mixture
from descentflow.generation.conditional._latent_density import Prior, posterior_of
from descentflow.generation.sample import sample
from descentflow.representation.linear_curves import LinearCurves
from descentflow.surveillance.descents.prepared_descents import read_descents
from descentflow.surveillance.descents.store import KEY

SCRIPT = Path(__file__).resolve().parents[2] / "scripts" / "fuzz.py"


@pytest.mark.slow  # it makes models and files of every kind first
@pytest.mark.parametrize("cases", [40, 400])
def test_no_command_breaks_on_damaged_inputs(cases: int, tmp_path: Path) -> None:
    """Every case is accepted with its rows accounted for, or refused in a message; a new folder makes its own files."""
    words = [sys.executable, str(SCRIPT), str(tmp_path), "--cases", str(cases), "--seed", "0", "--processes", "1"]
    quiet = {name: value for name, value in os.environ.items() if name != "PYTHONWARNINGS"}
    done = subprocess.run(words, capture_output=True, text=True, check=False, env=quiet)
    assert done.returncode == 0, done.stdout + done.stderr[-3000:]
    assert done.stdout.splitlines()[-1] == f"{cases} cases, 0 defects"
    outcomes = [json.loads(line) for line in (tmp_path / "outcomes-0.jsonl").read_text().splitlines()]
    assert {outcome["case"] for outcome in outcomes} == set(range(cases))
    assert len({outcome["kind"] for outcome in outcomes}) > 10, "hardly a kind of input was tried"
    assert {outcome["verdict"] for outcome in outcomes} == {"accepted", "refused"}


def written(frame: pl.DataFrame, metadata: dict, path: Path) -> Path:
    frame.write_parquet(path, metadata={KEY: json.dumps(metadata)})
    return path


@pytest.mark.parametrize(
    ("change", "saying"),
    [
        (pl.col("IAS") * float("nan"), "column IAS holds .* not finite"),
        (pl.col("Mach") * 1e30, "column Mach holds .* outside 0.05 to 1"),
        (pl.col("level_fl").cast(pl.Float64), "column level_fl is of type Float64"),
        (pl.lit(200).cast(pl.Int32).alias("level_fl"), "column level_fl has .* levels twice"),
        (pl.col("flight_id").cast(pl.Binary), "column flight_id is of type Binary"),
        (pl.lit("high").alias("geoaltitude"), "column geoaltitude is of type String"),
        (pl.lit(None, pl.Float64).alias("time_s"), "column time_s lacks"),
        (pl.col("timestamp").dt.replace_time_zone(None), "column timestamp is of type"),
    ],
)
def test_prepared_descents_that_no_aircraft_flies(change: pl.Expr, saying: str, descents: Path, tmp_path: Path) -> None:
    whole = read_descents(descents)
    path = written(whole.frame.with_columns(change), whole.metadata, tmp_path / "changed.parquet")
    refuses(DataError, saying, read_descents, path)


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("bottom_fl", float("inf")),
        ("top_fl", {"A320": None}),
        ("report", {"steps": [{"step": 3}], "notes": {}}),
        ("report", {"steps": [{"step": "read", "rows_dropped": 0, "rows_left": 9}], "notes": {}}),
        ("report", {"steps": [], "notes": {"sorted": "all"}}),
        ("inputs", "all"),
    ],
)
def test_descriptions_that_nobody_wrote(name: str, value: object, descents: Path, tmp_path: Path) -> None:
    whole = read_descents(descents)
    path = written(whole.frame, whole.metadata | {name: value}, tmp_path / "changed.parquet")
    refuses(DataError, "a damaged description", read_descents, path)


@pytest.mark.parametrize("section", [3, None, {}, {"format": 2}])
def test_checkpoints_of_another_section(section: object, run: Path, tmp_path: Path) -> None:
    content = torch.load(run / "checkpoints" / "best.ckpt", weights_only=True)
    torch.save(content | {"descentflow": section}, tmp_path / "changed.ckpt")
    refuses(CheckpointError, r"changed\.ckpt", load_model, tmp_path / "changed.ckpt")


@pytest.mark.parametrize("seed", [1 << 64, 1 << 63, -(1 << 63) - 1])
def test_seeds_beyond_64_bits(seed: int, run: Path) -> None:
    refuses(ConfigError, "seed = ", sample, run / "checkpoints" / "best.ckpt", 2, seed=seed)
    assert len(sample(run / "checkpoints" / "best.ckpt", 2, seed=(1 << 63) - 1)) == 2


def test_a_flight_without_a_finite_density() -> None:
    mixture = Mixture(torch.ones(1).double(), torch.zeros(1, 2).double(), torch.eye(2)[None].double())
    endless = torch.tensor([1e200, 0.0]).double()
    curves = LinearCurves(torch.zeros(2).double(), torch.eye(2).double(), torch.ones(2).double(), 2)
    posterior = posterior_of(Prior(mixture, None), 3 * torch.eye(2).double(), endless, curves)
    refuses(SamplingError, "more than numbers can hold", posterior.draw, 5, torch.Generator().manual_seed(0))
