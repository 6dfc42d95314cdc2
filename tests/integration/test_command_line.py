"""The trainer's commands and sampling, run as a user runs them, on small prepared descents."""

import importlib.util
import os
import re
import warnings
from pathlib import Path

import numpy as np
import polars as pl
import pytest
import torch
import toys
import yaml
from scipy.io import netcdf_file

from descentflow.aircraft_types.registry import aircraft
from descentflow.cli.entry import main
from descentflow.densities.checkpoint import load_model
from descentflow.representation.read_checkpoint import read_checkpoint

CONFIGS = Path(__file__).resolve().parents[2] / "descentflow" / "configs"
QUICK = ["--trainer.enable_progress_bar=false", "--trainer.enable_model_summary=false", "--scores.n_samples=200"]


@pytest.fixture(scope="module")
def descents(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return toys.write_descents_file(tmp_path_factory.mktemp("data") / "a320.parquet", 300)


def fit(folder: Path, descents: Path, model: str, *more: str) -> Path:
    """Fit with a shipped config, in a folder of its own; returns the run's folder."""
    settings = ["--config", str(CONFIGS / "model" / f"{model}.yaml"), "--data.descents", str(descents)]
    where = ["--trainer.logger.init_args.save_dir", str(folder / "runs")]
    assert main(["fit", *settings, *where, *QUICK, *more]) == 0
    return next((folder / "runs" / model).iterdir())


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory, descents: Path) -> Path:
    return fit(tmp_path_factory.mktemp("gaussian"), descents, "gaussian")


@pytest.mark.parametrize(
    ("model", "epochs", "kind"),
    [
        ("gmm", 5, "GaussianMixture"),
        ("gmm_svi", 2, "GaussianMixture"),
        ("flow", 3, "MaskedAffineFlow"),
        ("gmm_paper", 5, "GaussianMixture"),
        ("flow_paper", 2, "MaskedAffineFlow"),
        ("spline", 2, "SplineFlow"),
    ],
)
def test_each_shipped_model_fits_and_its_checkpoint_samples(
    model: str, epochs: int, kind: str, tmp_path: Path, descents: Path
) -> None:
    folder = fit(tmp_path, descents, model, f"--trainer.max_epochs={epochs}")
    checkpoint = folder / "checkpoints" / "best.ckpt"
    assert type(load_model(checkpoint)).__name__ == f"{kind}Density"
    assert main(["sample", str(checkpoint), "-n", "20", "--out", str(tmp_path / "s.parquet")]) == 0
    assert pl.read_parquet(tmp_path / "s.parquet")["sample_id"].n_unique() == 20


def test_quickstart_config_is_complete(tmp_path: Path, descents: Path) -> None:
    settings = ["--config", str(CONFIGS / "experiment" / "quickstart.yaml"), "--data.descents", str(descents)]
    where = ["--trainer.logger.init_args.save_dir", str(tmp_path)]
    assert main(["fit", *settings, *where, *QUICK, "--trainer.max_epochs=1"]) == 0
    assert (tmp_path / "quickstart" / "version_0" / "checkpoints" / "best.ckpt").is_file()


def test_a_fit_without_a_config_stops_by_itself_in_a_folder_named_after_its_model(
    tmp_path: Path, descents: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The first run that `descentflow --help` shows."""
    monkeypatch.chdir(tmp_path)
    assert main(["fit", "--model", "Gaussian", "--data.descents", str(descents), *QUICK]) == 0
    checkpoint = tmp_path / "runs" / "Gaussian" / "version_0" / "checkpoints" / "best.ckpt"
    assert read_checkpoint(checkpoint)["epoch"] == 0


def test_what_a_fit_leaves_behind(run: Path) -> None:
    assert {path.name for path in run.iterdir()} >= {"config.yaml", "checkpoints"}
    assert list(run.glob("events.out.tfevents*"))
    config = yaml.safe_load((run / "config.yaml").read_text())
    assert config["model"]["class_path"].endswith("Gaussian")
    split = read_checkpoint(run / "checkpoints" / "best.ckpt")["descentflow"]["representation"]["split"]
    parts = [set(split[name]) for name in ("train", "validation", "test")]
    assert [len(part) for part in parts] == [216, 24, 60]
    assert len(set.union(*parts)) == 300


def test_a_fit_ends_with_its_checkpoint_and_info_tells_what_it_holds(
    tmp_path: Path, descents: Path, monkeypatch: pytest.MonkeyPatch, capsys
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["fit", "--model", "Gaussian", "--data.descents", str(descents), *QUICK]) == 0
    said = capsys.readouterr().out
    path = "runs/Gaussian/version_0/checkpoints/best.ckpt"
    score = re.search(rf"wrote {path} \((val/nll \S+)\)\n  descentflow test --ckpt_path {path} ", said)
    assert score is not None, said
    assert main(["info", path]) == 0
    told = dict(line.split(": ", 1) for line in capsys.readouterr().out.splitlines()[1:])
    parts = load_model(path).representation
    assert told["flights"].startswith(f"{len(parts.split.train)} train, {len(parts.split.validation)} validation")
    assert told["aircraft"].startswith(parts.decoder.aircraft.typecode)
    assert told["score"].startswith(f"{score[1]} in epoch 1;")
    assert (told["context"], told["effects added"], told["cleaning"]) == ("none", "none", "the default thresholds")


def test_tensorboard_holds_scores_acceptance_and_figures(run: Path) -> None:
    from tensorboard.backend.event_processing.event_accumulator import EventAccumulator

    events = EventAccumulator(str(run), size_guidance={"images": 0})
    events.Reload()
    scalars = events.Tags()["scalars"]
    for name in ("val/nll", "val/acceptance", "val/rejected/drag_below_bound", "val/score/cas_below_transition/ks"):
        assert name in scalars
    assert "val/profiles" in events.Tags()["images"]


def test_test_scores_the_held_out_flights(run: Path, tmp_path: Path) -> None:
    checkpoint = run / "checkpoints" / "best.ckpt"
    where = ["--trainer.logger.init_args.save_dir", str(tmp_path)]
    assert main(["test", "--ckpt_path", str(checkpoint), *where, "--scores.n_test_samples=500"]) == 0
    folder = next((tmp_path / "gaussian").iterdir())
    rows = pl.read_csv(folder / "scores.csv")
    assert len(rows) == 4 * 5 + 2 + 2  # by part, of whole profiles, of whole descents
    assert set(rows["quantity"]) >= {"time_to_bottom_of_descent", "rocd_below_transition"}
    assert (folder / "profiles.png").stat().st_size > 10_000


def test_predict_names_every_held_out_flight(run: Path, tmp_path: Path) -> None:
    checkpoint = run / "checkpoints" / "best.ckpt"
    assert main(["predict", "--ckpt_path", str(checkpoint), f"--trainer.logger.init_args.save_dir={tmp_path}"]) == 0
    table = pl.read_csv(next(tmp_path.rglob("log_prob.csv")))
    split = read_checkpoint(checkpoint)["descentflow"]["representation"]["split"]
    assert set(table["flight_id"]) == set(split["test"])
    assert table["log_prob"].is_sorted()


@pytest.mark.parametrize("command", ["test", "predict", "validate"])
def test_no_command_scores_random_weights(command: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main([command]) == 2
    assert "without a checkpoint" in capsys.readouterr().err


def test_sample_table(run: Path, tmp_path: Path) -> None:
    checkpoint = str(run / "checkpoints" / "best.ckpt")
    for name in ("a.parquet", "b.parquet"):
        assert main(["sample", checkpoint, "-n", "50", "--seed", "3", "--out", str(tmp_path / name)]) == 0
    first, second = pl.read_parquet(tmp_path / "a.parquet"), pl.read_parquet(tmp_path / "b.parquet")
    assert first.equals(second), "the same seed gives the same samples, bit for bit"
    assert first.columns == [
        "sample_id", "level_fl", "time_s", "altitude_ft", "CAS", "Mach", "TAS", "vertical_rate", "drag_n",
    ]  # fmt: skip
    assert first["sample_id"].n_unique() == 50
    assert (first["vertical_rate"] < 0).all()
    assert (first["altitude_ft"] == 100 * first["level_fl"]).all()
    steps = first.with_columns(pl.col("time_s").diff().over("sample_id").alias("step"))["step"].drop_nulls()
    assert (steps > 0).all(), "time grows down each sample's rows"
    # The average rate of each interval explains its time: units and signs agree.
    one = first.filter(sample_id=0)
    height = -np.diff(one["altitude_ft"].to_numpy())
    mean_slowness = -(0.5 / one["vertical_rate"].to_numpy()[1:] + 0.5 / one["vertical_rate"].to_numpy()[:-1])
    np.testing.assert_allclose(np.diff(one["time_s"].to_numpy()), 60 * height * mean_slowness, rtol=0.02)


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


def test_evaluate_leaves_out_what_was_trained_on(run: Path, descents: Path, tmp_path: Path, capsys) -> None:
    checkpoint = str(run / "checkpoints" / "best.ckpt")
    assert main(["evaluate", checkpoint, "--real", str(descents), "--out", str(tmp_path / "old"), "-n", "300"]) == 0
    assert "60 held-out flights (240 left out" in capsys.readouterr().out
    other = toys.write_descents_file(tmp_path / "new.parquet", 80, seed=9)
    assert main(["evaluate", checkpoint, "--real", str(other), "--out", str(tmp_path / "new"), "-n", "300"]) == 0
    assert "80 held-out flights (0 left out" in capsys.readouterr().out
    assert {p.name for p in (tmp_path / "new").iterdir()} >= {"scores.csv", "rejections.json", "profiles.png"}


def test_a_killed_fit_resumes_from_its_last_checkpoint(tmp_path: Path, descents: Path) -> None:
    """Three epochs, then three more from last.ckpt: counters and the optimizer's schedule go on where they were."""
    stop = "--trainer.callbacks=[{class_path: toys.StopAfterThree}]"
    part = fit(tmp_path, descents, "gmm_svi", "--trainer.max_epochs=6", stop)
    last = part / "checkpoints" / "last.ckpt"
    before = torch.load(last, weights_only=True)
    assert before["epoch"] == 2
    words = ["--config", str(part / "config.yaml"), "--ckpt_path", str(last), "--trainer.callbacks=null"]
    assert main(["fit", *words, f"--trainer.logger.init_args.save_dir={tmp_path / 'resumed'}"]) == 0
    resumed = next((tmp_path / "resumed" / "gmm_svi").iterdir()) / "checkpoints" / "last.ckpt"
    after = torch.load(resumed, weights_only=True)
    assert after["epoch"] == 5
    assert after["global_step"] == 2 * before["global_step"]
    assert after["lr_schedulers"][0]["last_epoch"] == 6
    name = "_density.program.locs_unconstrained"
    assert after["state_dict"][name].shape == before["state_dict"][name].shape, "BIC is not asked again"


class Payload:
    def __init__(self, target: Path) -> None:
        self.target = target

    def __reduce__(self) -> tuple[object, tuple[str]]:
        return os.system, (f"touch {self.target}",)


def test_resuming_executes_nothing_of_what_a_checkpoint_holds(
    run: Path, descents: Path, tmp_path: Path, capsys
) -> None:
    evil = tmp_path / "evil.ckpt"
    content = torch.load(run / "checkpoints" / "best.ckpt", weights_only=True)
    torch.save({**content, "extra": Payload(tmp_path / "owned")}, evil)
    words = ["fit", "--config", str(run / "config.yaml"), "--ckpt_path", str(evil)]
    assert main(words) == 2
    assert "could execute code" in capsys.readouterr().err
    assert main([*words, "--weights_only=false"]) == 2
    assert "never executes code" in capsys.readouterr().err
    assert not (tmp_path / "owned").exists()


def test_resuming_on_other_flights_is_refused(run: Path, tmp_path: Path, capsys) -> None:
    other = toys.write_descents_file(tmp_path / "other.parquet", 300, seed=4)
    words = ["--config", str(run / "config.yaml"), "--ckpt_path", str(run / "checkpoints" / "last.ckpt")]
    where = ["--trainer.logger.init_args.save_dir", str(tmp_path), "--data.descents", str(other)]
    assert main(["fit", *words, *where, "--trainer.max_epochs=2"]) == 2
    assert "trained on other flights" in capsys.readouterr().err


def test_a_run_from_before_the_models_moved_is_tested_as_ever(run: Path, tmp_path: Path) -> None:
    """Its config.yaml and its checkpoint name descentflow.models.Gaussian."""
    content = torch.load(run / "checkpoints" / "best.ckpt", weights_only=True)
    assert content["hyper_parameters"]["_class_path"] == "descentflow.training.models.Gaussian"
    content["hyper_parameters"]["_class_path"] = "descentflow.models.Gaussian"
    older = tmp_path / "older"
    (older / "checkpoints").mkdir(parents=True)
    torch.save(content, older / "checkpoints" / "best.ckpt")
    text = (run / "config.yaml").read_text()
    assert text.count("descentflow.training.models") == 1
    (older / "config.yaml").write_text(text.replace("descentflow.training.models", "descentflow.models"))
    scores = {}
    for folder in (run, older):
        where = ["--trainer.logger.init_args.save_dir", str(tmp_path / f"again_{folder.name}")]
        words = ["--ckpt_path", str(folder / "checkpoints" / "best.ckpt"), "--scores.n_test_samples=200", *where]
        with warnings.catch_warnings(record=True) as said:
            warnings.simplefilter("always")
            assert main(["test", *words]) == 0
        assert any("is descentflow.training.models.Gaussian now" in str(w.message) for w in said) is (folder is older)
        scores[folder] = next((tmp_path / f"again_{folder.name}").rglob("scores.csv")).read_text()
    assert scores[run] == scores[older]


@pytest.mark.parametrize(
    ("word", "said"),
    [
        ("--model.init_args.n_flowz=3", "did you mean --model.n_flows?"),
        ("--model.init_args.n_flows=-3", "n_flows"),
        ("--data.test_fraction=1.5", "data.test_fraction"),
        ("--trainer.max_epoks=3", "--trainer.max_epoks"),
        ("--trainer.max_epochs=many", "many"),
    ],
)
def test_typos_and_impossible_settings_are_refused_in_a_line(word: str, said: str, descents: Path, capsys) -> None:
    assert main(["fit", "--model", "MaskedAffineFlow", "--data.descents", str(descents), word]) == 2
    message = capsys.readouterr().err
    assert message.startswith("descentflow fit: ")
    assert said in message
    assert message.count("\n") == 1


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["nonsense"], "no command 'nonsense'"),
        (["sample", "absent.ckpt", "--out", "s.parquet"], "no file absent.ckpt"),
        (["evaluate", "absent.ckpt", "--real", "d.parquet", "--out", "e"], "no file absent.ckpt"),
    ],
)
def test_mistakes_end_with_a_message_and_status_two(words: list[str], message: str, capsys) -> None:
    assert main(words) == 2
    assert message in capsys.readouterr().err


def test_bad_outputs_of_sample(run: Path, tmp_path: Path, capsys) -> None:
    checkpoint = str(run / "checkpoints" / "best.ckpt")
    for out, message in (("s.xlsx", "extension among"), ("no/such/s.parquet", "does not exist")):
        assert main(["sample", checkpoint, "-n", "3", "--out", str(tmp_path / out)]) == 2
        assert message in capsys.readouterr().err
    assert main(["sample", checkpoint, "-n", "0", "--out", str(tmp_path / "s.parquet")]) == 2
    assert list(tmp_path.iterdir()) == [], "nothing half-written is left"


def test_descents_of_several_types_need_an_aircraft(tmp_path: Path, capsys) -> None:
    first = pl.read_parquet(toys.write_descents_file(tmp_path / "a.parquet", 30))
    metadata = pl.read_parquet_metadata(tmp_path / "a.parquet")
    other = pl.when(pl.col("flight_id") > "toy-0-00015").then(pl.lit("B738")).otherwise("typecode").alias("typecode")
    first.with_columns(other).write_parquet(
        tmp_path / "mixed.parquet", metadata={"descentflow": metadata["descentflow"]}
    )
    assert main(["fit", "--model", "Gaussian", "--data.descents", str(tmp_path / "mixed.parquet"), *QUICK]) == 2
    assert "types" in capsys.readouterr().err


def test_a_licence_holders_directory_serves_the_whole_path(tmp_path: Path) -> None:
    """EUROCONTROL's files as they come (here the dummies): rows, descents, checkpoint and samples are of that type."""
    spec = importlib.util.find_spec("pyBADA")
    assert spec is not None, "the test extra installs pybada"
    release = Path(str(spec.origin)).parent / "aircraft" / "BADA3" / "DUMMY"
    rows, prepared = tmp_path / "rows.parquet", tmp_path / "descents.parquet"
    flown = ["simulate", "--typecode", "J2H", "--bada-dir", str(release), "--flights", "60", "--out", str(rows)]
    assert main(flown) == 0
    assert main(["prepare", str(rows), "--out", str(prepared)]) == 0
    run = fit(tmp_path / "run", prepared, "gaussian", "--data.bada_dir", str(release))
    checkpoint = next(run.rglob("best.ckpt"))
    assert load_model(checkpoint).representation.decoder.aircraft == aircraft("J2H", release)
    assert main(["sample", str(checkpoint), "-n", "5", "--out", str(tmp_path / "samples.parquet")]) == 0


def test_predict_descent_writes_intervals_and_occupancy(run: Path, descents: Path, tmp_path: Path, capsys) -> None:
    words = ["predict-descent", str(run / "checkpoints" / "best.ckpt"), str(descents), "--from-fl", "290", "-n", "40"]
    assert main([*words, "--out", str(tmp_path / "p.parquet"), "--occupancy", str(tmp_path / "o.parquet")]) == 0
    said = capsys.readouterr().out
    assert "calibrated on the checkpoint's validation flights" in said
    assert "90 % intervals hold" in said
    table = pl.read_parquet(tmp_path / "p.parquet")
    assert (table["q05_s"] <= table["q95_s"]).all()
    assert set(pl.read_parquet(tmp_path / "o.parquet")["flight_id"]) == set(table["flight_id"])
    assert main([*words, "--flight", "nobody", "--out", str(tmp_path / "p.parquet")]) == 2
    assert "was not trained or validated on" in capsys.readouterr().err


def test_a_conditional_model_from_fit_to_samples(tmp_path: Path, descents: Path, capsys) -> None:
    """Every command with a context: fitted, scored, evaluated on each flight's own, sampled with what is given."""
    flights = pl.read_parquet(descents)["flight_id"].unique().sort()
    speeds = pl.Series([("SLO", "FST", "MID")[i % 3] for i in range(len(flights))])
    table = pl.DataFrame({"flight_id": flights, "operator": speeds, "deviation_k": np.arange(len(flights)) % 7.0})
    table.write_csv(tmp_path / "context.csv")
    context = ["--data.context=[operator,deviation_k,entry_fl]", f"--data.context_table={tmp_path / 'context.csv'}"]
    folder = fit(tmp_path, descents, "gaussian", *context)
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
    words = ["predict-descent", checkpoint, str(descents), "--from-fl", "290", "-n", "20", *known]
    words += ["--flight", reaching["flight_id"][0]]
    assert main([*words, "--out", str(tmp_path / "p.parquet")]) == 0
    capsys.readouterr()
    for bad, message in (
        ([], "a conditional model without a context"),
        (["--given", "operator=FST"], "no value for the context deviation_k, entry_fl"),
        (["--given", *given[2:], "operator=XXX"], "operator (one of"),
        (["--given", "operator"], "NAME=VALUE"),
        (["--given", *given[1:], "wind=3"], "context wind"),
    ):
        assert main(["sample", checkpoint, "-n", "3", *bad, "--out", str(out)]) == 2
        assert message in capsys.readouterr().err


def test_a_model_without_context_refuses_one(run: Path, tmp_path: Path, capsys) -> None:
    words = ["sample", str(run / "checkpoints" / "best.ckpt"), "--given", "hour=3", "--out", str(tmp_path / "s.csv")]
    assert main(words) == 2
    assert "knows no context" in capsys.readouterr().err
