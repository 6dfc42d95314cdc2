"""Fitting from Python trains what the command line trains, whatever holds the descents."""

import re
import signal
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import polars as pl
import pytest
import torch
from command_line_toys import QUICK
from refusals import refuses
from toys import assert_equal

from descentflow.cli.entry import main
from descentflow.core.errors import ConfigError, DataError
from descentflow.densities.checkpoint import load_model
from descentflow.generation.sample import sample
from descentflow.repairs.repair import repair
from descentflow.representation.read_checkpoint import read_checkpoint
from descentflow.surveillance.descents.prepared_descents import Descents, read_descents
from descentflow.training.datamodule import DescentDataModule
from descentflow.training.fit import fit
from descentflow.training.models import Gaussian, GaussianMixture, MaskedAffineFlow
from descentflow.training.models.latent_model import LatentModel
from descentflow.training.training_settings import settings_of, training_settings

pytestmark = pytest.mark.usefixtures("plain_figures")


def test_a_settings_file_of_ones_own(tmp_path: Path, descents: Path) -> None:
    own = tmp_path / "own.yaml"
    own.write_text(
        "model:\n  class_path: descentflow.training.models.Gaussian\n  init_args:\n    ridge: 2\n    jitter: 1e-4\n"
        "data:\n  explained_variance: 0.7\n  seed: 5\ntrainer:\n  max_epochs: 1\n"
    )
    model = fit(descents, str(own), final=False)
    assert model.hparams["jitter"] == 1e-4
    where = ["--trainer.logger.init_args.save_dir", str(tmp_path)]
    assert main(["fit", "--config", str(own), "--data.descents", str(descents), *where, *QUICK, "--final=false"]) == 0
    assert_equal(model.density, load_model(next(tmp_path.rglob("best.ckpt"))))
    other = fit(descents, str(own), explained_variance=0.999, final=False)
    assert other.representation.decoder.dimension > model.representation.decoder.dimension


def test_a_path_descents_in_memory_and_a_data_module_give_the_same(descents: Path) -> None:
    expected = fit(descents, "gaussian").density
    assert_equal(fit(str(descents), "gaussian").density, expected)
    in_memory = fit(read_descents(descents), Gaussian())
    assert_equal(in_memory.density, expected)
    assert in_memory.representation.provenance["descents"] == "in memory"
    assert_equal(fit(DescentDataModule(descents), Gaussian()).density, expected)
    assert_equal(fit([descents], "gaussian", split_by="flight").density, expected)


@pytest.mark.parametrize("density", [Gaussian(), MaskedAffineFlow()])
def test_a_fleet_of_one_speed_has_no_component_of_cas(descents: Path, density: LatentModel) -> None:
    flights = read_descents(descents)
    few = flights.frame.filter(pl.col("flight_id") < "toy-0-00080")
    alike = Descents(few.drop("Mach", "TAS", strict=False).with_columns(IAS=pl.lit(280.0)), flights.metadata)
    own = fit(alike, density, max_epochs=1, final=False)
    assert own.representation.decoder.cas_basis.n_components == 0
    cas_kt = sample(own, 20, seed=0).to_polars()["CAS"].drop_nulls().to_numpy()
    assert float(abs(cas_kt - 280.0).max()) < 0.15  # its noise is 0.03 kt
    if isinstance(density, Gaussian):
        repair(alike, aircraft="A320")


def test_random_numbers_and_threads_outside_go_on_as_before(descents: Path) -> None:
    threads = torch.get_num_threads()
    torch.manual_seed(7)
    expected = torch.rand(3)
    torch.manual_seed(7)
    fit(descents, "gaussian", seed=3, explained_variance=0.83)  # its components are fitted here and for no other test
    assert torch.equal(torch.rand(3), expected)
    assert torch.get_num_threads() == threads


def test_fits_of_one_seed_in_two_threads_equal_the_fit_alone(descents: Path) -> None:
    options = {"seed": 3, "max_epochs": 2, "final": False}
    expected = fit(descents, "flow", **options).density
    with ThreadPoolExecutor(2) as pool:
        both = [pool.submit(fit, descents, "flow", **options) for _ in range(2)]
    for fitted in both:
        assert_equal(fitted.result().density, expected)


def test_descents_on_fewer_levels_than_a_stencil_of_noise_are_fitted(descents: Path) -> None:
    whole = read_descents(descents)
    narrow = Descents(
        whole.frame.filter(pl.col("level_fl").is_between(241, 250)), whole.metadata | {"bottom_fl": 241, "top_fl": 250}
    )
    assert "on FL241-250" in str(fit(narrow, "gaussian"))


def test_the_checkpoint_written_is_the_model(descents: Path, tmp_path: Path) -> None:
    model = fit(descents, GaussianMixture(n_clusters=2), out=tmp_path / "fitted.ckpt", context=["entry_fl"])
    loaded = load_model(tmp_path / "fitted.ckpt")
    assert model.final is not None
    assert_equal(loaded, model.final)
    assert_equal(loaded.held_out_fit, model.density)
    model.save(tmp_path / "again.ckpt")
    assert_equal(load_model(tmp_path / "again.ckpt"), model.final)
    assert read_checkpoint(tmp_path / "again.ckpt")["hyper_parameters"]["n_clusters"] == 2
    # Lightning itself reads it too.
    by_lightning = GaussianMixture.load_from_checkpoint(tmp_path / "again.ckpt")
    assert_equal(by_lightning.density, model.density)
    assert_equal(by_lightning.final, model.final)
    context = torch.zeros(1, loaded.n_context, dtype=torch.float64)
    assert torch.equal(model.sample(5, 0, context), loaded.held_out_fit.sample(5, 0, context))


def test_a_model_says_what_it_is(descents: Path) -> None:
    assert str(Gaussian()) == "Gaussian, not fitted yet"
    model = fit(descents, "gaussian", context=["entry_fl"])
    head, trained, sampled, given = str(model).splitlines()
    assert re.fullmatch(r"Gaussian of \d+ weights \(\d+ of drag, \d+ of CAS\) on FL150-\d{3}, A320", head)
    assert re.fullmatch(r"216 flights trained it, 24 validated it: val/nll -?[\d.]+ in epoch 1", trained)
    assert sampled == "sampled: the final fit, to all 300 flights, none held out"
    assert "entry_fl" in given


def test_an_instance_is_trained_with_the_settings_of_its_class() -> None:
    assert training_settings("MaskedAffineFlow") == training_settings("flow")
    assert settings_of(MaskedAffineFlow(n_flows=2)).checkpoint["monitor"] == "val/bound"

    class Own(Gaussian):
        """A model of the user's."""

    settings = settings_of(Own())
    assert (settings.trainer["max_epochs"], settings.checkpoint["monitor"]) == (200, "val/nll")


def test_what_cannot_be_fitted_is_refused(descents: Path, tmp_path: Path) -> None:
    refuses(ConfigError, "gaussian, mixture, flow", fit, descents, "transformer")
    refuses(ConfigError, r"an option epochs of fit; .*did you mean max_epochs\?", fit, descents, "gaussian", epochs=3)
    with pytest.raises(ConfigError, match=r"an option n_clusters of fit; .*as Gaussian\(ridge=2\)"):
        fit(descents, "mixture", n_clusters=3)
    refuses(ConfigError, "gaussian, mixture, flow", fit, descents, "x" * 300)
    refuses(ConfigError, "seed = -1; expected a whole number, from 0", fit, descents, "gaussian", seed=-1)
    refuses(ConfigError, "max_epochs = 0", fit, descents, "gaussian", max_epochs=0)
    refuses(ConfigError, "device = 'tpu'; expected 'cpu' or 'cuda'", fit, descents, "gaussian", device="tpu")
    refuses(ConfigError, "a DataModule and split_by", fit, DescentDataModule(descents), "gaussian", split_by="aircraft")
    refuses(DataError, "no file", fit, tmp_path / "absent.parquet", "gaussian")
    (tmp_path / "bare.yaml").write_text("data:\n  seed: 1\n")
    refuses(ConfigError, "without a model", training_settings, tmp_path / "bare.yaml")
    (tmp_path / "odd.yaml").write_text("model:\n  class_path: descentflow.training.models.Nothing\n")
    refuses(ConfigError, r"class descentflow\.training\.models\.Nothing", fit, descents, str(tmp_path / "odd.yaml"))
    pl.DataFrame({"flight_id": ["a"]}).write_parquet(tmp_path / "rows.parquet")
    refuses(DataError, "not prepared descents", fit, tmp_path / "rows.parquet", "gaussian")


def test_an_interruption_is_one_in_python_and_the_next_is_heard(
    descents: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Lightning made it SystemExit, which ended a session of Python or a service."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    monkeypatch.setattr(Gaussian, "on_train_epoch_start", lambda _: signal.raise_signal(signal.SIGINT))
    try:
        for _ in range(2):
            with pytest.raises(KeyboardInterrupt):
                fit(descents, model="gaussian")
    finally:
        signal.signal(signal.SIGINT, before)


OPTIONAL = ("sklearn", "pyro", "normflows")
"""Large packages that only some of the models need."""
NEVER = ("pandas", "xarray", "distributed", "jsbsim", "onnx", "openap", "traffic")
"""Large packages that no fit of a flow or a Gaussian needs."""

FIRST_STEP = f"""
import os, sys
from lightning.pytorch import Callback

class FirstStep(Callback):
    def on_train_batch_end(self, *_):
        print("loaded", *(name for name in {(*OPTIONAL, *NEVER)!r} if name in sys.modules), flush=True)
        os._exit(0)
"""
"""A callback that lists what is loaded, and ends the process: scores and figures come later."""


@pytest.mark.parametrize(
    ("settings", "needed"),
    [
        pytest.param("gaussian", set(), marks=pytest.mark.slow),
        ("flow", {"normflows"}),
        pytest.param("gmm", {"sklearn", "pyro"}, marks=pytest.mark.slow),
        pytest.param("gmm_svi", {"sklearn", "pyro"}, marks=pytest.mark.slow),
    ],
)
def test_a_fit_loads_the_libraries_of_its_model_alone(
    settings: str, needed: set[str], descents: Path, tmp_path: Path
) -> None:
    (tmp_path / "first_step.py").write_text(FIRST_STEP)
    words = ["fit", "--config", settings, "--data.descents", str(descents), "--quiet"]
    words += ["--trainer.callbacks+=first_step.FirstStep"]
    code = f"from descentflow.cli.entry import main; main({words!r})"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, cwd=tmp_path)
    said = [line.split() for line in done.stdout.splitlines() if line.startswith("loaded")]
    assert len(said) == 1, done.stderr
    loaded = set(said[0][1:])
    # scikit-learn takes pandas where it is installed.
    assert loaded - ({"pandas"} if "sklearn" in needed else set()) == needed
