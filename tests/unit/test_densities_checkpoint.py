"""Checkpoints hold all that sampling needs, load without executing code, and say what is wrong with them."""

import os
import pickle
import zipfile
from datetime import date
from pathlib import Path

import pytest
import torch
import toys
from lightning.pytorch import Trainer

from descentflow.core.errors import CheckpointError, ConfigError
from descentflow.densities import GaussianDensity, MaskedAffineFlowDensity
from descentflow.densities.checkpoint import as_density, content_of, load_model
from descentflow.generation.rejection import sample_descents
from descentflow.training.models import Gaussian, GaussianMixture, LatentModel, MaskedAffineFlow

DIMENSION = 4
MODELS = {
    "gaussian": (Gaussian, {}, 1),
    "mixture": (GaussianMixture, {"n_clusters": 3}, 3),
    "svi": (GaussianMixture, {"n_clusters": 2, "training": "svi"}, 2),
    "flow": (MaskedAffineFlow, {"n_flows": 2}, 2),
}


def weights(n: int = 900) -> torch.Tensor:
    x = torch.randn(n, DIMENSION, generator=torch.Generator().manual_seed(0), dtype=torch.float64)
    x[: n // 2, 0] += 5
    return x


def saved(name: str, folder: Path) -> tuple[LatentModel, Path]:
    kind, settings, epochs = MODELS[name]
    model = kind(**settings)
    trainer = Trainer(
        max_epochs=epochs, logger=False, enable_progress_bar=False, enable_model_summary=False, accelerator="cpu",
        enable_checkpointing=False, num_sanity_val_steps=0,
    )  # fmt: skip
    trainer.fit(model, datamodule=toys.WeightsModule(weights(), weights(100)))
    trainer.save_checkpoint(folder / "model.ckpt")
    return model.eval(), folder / "model.ckpt"


@pytest.mark.parametrize("name", MODELS)
def test_a_checkpoint_alone_samples_as_its_model_did(name: str, tmp_path: Path) -> None:
    model, path = saved(name, tmp_path)
    loaded = load_model(path)
    assert type(loaded) is type(model.density)
    assert torch.equal(loaded.sample(50, seed=1), model.sample(50, seed=1))
    with torch.no_grad():
        torch.testing.assert_close(loaded.log_prob(weights(10)), model.log_prob(weights(10)))
    parts = loaded.representation
    samples = sample_descents(loaded, parts, 5, seed=0, entry=torch.tensor([30]))
    assert len(samples.trajectories) == 5


def unfitted(folder: Path) -> Path:
    """A checkpoint of a density with the parameters that it starts with."""
    with torch.random.fork_rng():
        torch.manual_seed(0)
        density = MaskedAffineFlowDensity(DIMENSION, n_flows=1)
    density.attach(toys.representation_of(DIMENSION))
    torch.save(content_of(density), folder / "model.ckpt")
    return folder / "model.ckpt"


def test_draws_are_the_same_under_another_default_precision(tmp_path: Path) -> None:
    path = unfitted(tmp_path)
    single = load_model(path).sample(50, seed=1)
    torch.set_default_dtype(torch.float64)
    try:
        assert torch.equal(load_model(path).sample(50, seed=1), single)
    finally:
        torch.set_default_dtype(torch.float32)


class Payload:
    """Writes a file when it is unpickled."""

    def __init__(self, path: Path) -> None:
        self.path = path

    def __reduce__(self) -> tuple[object, tuple[str]]:
        return os.mkdir, (str(self.path),)


def test_loading_never_executes_code(tmp_path: Path) -> None:
    torch.save({"descentflow": Payload(tmp_path / "owned")}, tmp_path / "evil.ckpt")
    with pytest.raises(CheckpointError, match="tensors and primitives"):
        load_model(tmp_path / "evil.ckpt")
    (tmp_path / "plain.ckpt").write_bytes(pickle.dumps(Payload(tmp_path / "owned")))
    with pytest.raises(CheckpointError):
        load_model(tmp_path / "plain.ckpt")
    assert not (tmp_path / "owned").exists()


WARM = {"effects": {"temperature": [8.0]}, "mass_kg": 6e4, "inherited": False, "of_training": {}}
"""Correction of a simulator."""
COLUMN = {"name": "a", "kind": "number", "mean": 0.0, "scale": 1.0, "values": [], "indicator": False}
"""A column of a context, as checkpoints keep it."""


def broken(kind: str, folder: Path) -> Path:
    _, path = saved("gaussian", folder)
    content = torch.load(path, weights_only=True)
    target = folder / "broken.ckpt"
    if kind == "truncated":
        target.write_bytes(path.read_bytes()[:-2000])
        return target
    if kind == "one byte":
        whole = path.read_bytes()
        place = whole.index(content["state_dict"]["_density.loc"].numpy().tobytes())
        target.write_bytes(whole[:place] + bytes([whole[place] ^ 1]) + whole[place + 1 :])
        return target
    if kind == "compressed":
        with zipfile.ZipFile(path) as old, zipfile.ZipFile(target, "w", zipfile.ZIP_DEFLATED) as new:
            for name in old.namelist():
                new.writestr(name, old.read(name))
        return target
    if kind == "empty":
        target.write_bytes(b"")
        return target
    if kind == "text":
        target.write_text("not a checkpoint")
        return target
    if kind == "rows":
        target.write_text("a,b\n1,2\n")
        return target
    if kind == "unsafe":
        torch.save({"a": date(2020, 1, 1)}, target)
        return target
    changes = {
        "foreign": lambda c: c.pop("descentflow"),
        "format": lambda c: c["descentflow"].update(format=99),
        "model": lambda c: c["descentflow"].update(model="Diffusion"),
        "entry law": lambda c: c["descentflow"]["settings"].update(entry_law={"edges": []}),
        "incomplete": lambda c: c["descentflow"]["representation"].pop("decoder"),
        "parameters": lambda c: c["state_dict"].pop("_density.loc"),
        "aircraft": lambda c: c["descentflow"]["representation"]["decoder"]["aircraft"].pop("ct1"),
        "counts": lambda c: c["descentflow"]["representation"]["plausibility"]["entry_counts"].unsqueeze_(0),
        "coefficient": lambda c: c["descentflow"]["representation"]["decoder"]["aircraft"].update(ct2=-1e30),
        "range": lambda c: c["descentflow"]["representation"].update(context=[{**COLUMN, "low": "zero"}]),
        "flag": lambda c: c["descentflow"]["representation"].update(context=[{**COLUMN, "mean": True}]),
        "gaps": lambda c: c["descentflow"]["representation"].pop("gaps"),
        "own mass": lambda c: c["descentflow"]["representation"].update(own_mass={"column": "mass_kg"}),
        "mass": lambda c: c["descentflow"]["representation"]["decoder"].update(correction={**WARM, "mass_kg": [6e4]}),
        "effect": lambda c: c["descentflow"]["representation"]["decoder"].update(
            correction={**WARM, "effects": {"temperature": []}}
        ),
        "column": lambda c: c["descentflow"]["representation"].update(context=[{**COLUMN, "code": "x"}]),
    }
    changes[kind](content)
    torch.save(content, target)
    return target


@pytest.mark.parametrize(
    ("kind", "words"),
    [
        ("truncated", "truncated"),
        ("one byte", "differs from its checksum; expected a whole checkpoint"),
        ("compressed", "a compressed archive"),
        ("empty", "is empty"),
        ("text", "is no checkpoint; expected a checkpoint of descentflow; .* --simulator"),
        ("rows", "is no checkpoint"),
        ("unsafe", "holds datetime.date, which could execute code"),
        ("foreign", "not a checkpoint of descentflow"),
        ("format", "format 99"),
        ("model", "Diffusion"),
        ("entry law", "a GaussianDensity of another version, with entry_law; .* fit again"),
        ("incomplete", "decoder"),
        ("mass", "float"),
        ("effect", "0 parameters of temperature"),
        ("parameters", "state_dict"),
        ("aircraft", "ct1"),
        ("counts", "entry_counts is not on the grid"),
        ("coefficient", "coefficient ct2 = .-1e\\+30.; expected a number from"),
        ("range", "context column .*zero"),
        ("flag", "context column .*True"),
        ("gaps", "representation.gaps is of type NoneType; expected a text; .* fit again"),
        ("own mass", "the representation has 'own_mass'; expected .*seen_flights"),
        ("column", "code"),
    ],
)
def test_a_bad_checkpoint_says_what_is_wrong(kind: str, words: str, tmp_path: Path) -> None:
    with pytest.raises(Exception, match=words) as caught:
        load_model(broken(kind, tmp_path))
    assert type(caught.value).__module__ == "descentflow.core.errors"
    assert "weights_only" not in str(caught.value), "torch's advice would execute what the file holds"


def test_no_file(tmp_path: Path) -> None:
    with pytest.raises(CheckpointError, match="no file"):
        load_model(tmp_path / "absent.ckpt")
    with pytest.raises(CheckpointError, match=r"is a folder.*fit` wrote"):
        load_model(tmp_path)
    for version in ("version_0", "version_1"):
        (tmp_path / version / "checkpoints").mkdir(parents=True)
        (tmp_path / version / "checkpoints" / "best.ckpt").touch()
    with pytest.raises(CheckpointError, match=r"is a folder.* pass .*version_1/checkpoints/best.ckpt"):
        load_model(tmp_path)
    with pytest.raises(CheckpointError, match=r"is a folder.* pass .*version_0/checkpoints/best.ckpt"):
        load_model(tmp_path / "version_0")


@pytest.mark.parametrize("model", [None, 3, [], Gaussian, torch.nn.Linear(2, 2)])
def test_what_holds_no_density_says_what_would(model: object) -> None:
    with pytest.raises(ConfigError, match="checkpoint, a Density, or a fitted model"):
        as_density(model)


def test_an_unfitted_model_or_density_is_no_model_to_use() -> None:
    with pytest.raises(ConfigError, match="without a density"):
        as_density(Gaussian())
    with pytest.raises(ConfigError, match="without a representation"):
        as_density(GaussianDensity(3))


def test_a_model_on_another_device_leaves_the_representation_of_its_data_where_it_is() -> None:
    data = toys.WeightsModule(weights(), weights(100))
    model = Gaussian()
    model.attach(data.representation)
    assert {parameter.device.type for parameter in data.representation.buffers()} == {"cpu"}
    model.to("meta")  # stands for a GPU here
    assert model.density.representation.decoder.levels_fl.device.type == "meta"
    assert data.representation.decoder.levels_fl.device.type == "cpu"
