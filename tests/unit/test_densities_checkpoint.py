"""Checkpoints hold all that sampling needs, load without executing code, and say what is wrong with them."""

import os
import pickle
import zipfile
from datetime import date
from pathlib import Path

import pytest
import torch
import toys
from refusals import refuses

from descentflow.core.errors import CheckpointError, ConfigError
from descentflow.densities import GaussianDensity, MaskedAffineFlowDensity
from descentflow.densities.checkpoint import as_density, content_of, load_model
from descentflow.generation.rejection import sample_descents
from descentflow.training.fit import fit
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
    model = toys.fit(model, toys.WeightsModule(weights(), weights(100)), epochs)
    model.trainer.save_checkpoint(folder / "model.ckpt")
    return model, folder / "model.ckpt"


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
    refuses(CheckpointError, "tensors and primitives", load_model, tmp_path / "evil.ckpt")
    (tmp_path / "plain.ckpt").write_bytes(pickle.dumps(Payload(tmp_path / "owned")))
    with pytest.raises(CheckpointError):
        load_model(tmp_path / "plain.ckpt")
    assert not (tmp_path / "owned").exists()


WARM = {"effects": {"temperature": [8.0]}, "mass_kg": 6e4, "inherited": False, "of_training": {}}
"""Correction of a simulator."""
COLUMN = {"name": "a", "kind": "number", "mean": 0.0, "scale": 1.0, "values": [], "indicator": False}
"""A column of a context, as checkpoints keep it."""
GONE = object()
PARTS = "descentflow.representation"
CHANGED: list[tuple[str, object, str]] = [
    ("descentflow", GONE, "not a checkpoint of descentflow"),
    ("descentflow.format", 99, "format 99"),
    ("descentflow.model", "Diffusion", "Diffusion"),
    (
        "descentflow.settings.entry_law",
        {"edges": []},
        "a GaussianDensity of another version, with entry_law; .* fit again",
    ),
    ("state_dict._density_loc", GONE, "state_dict"),
    (f"{PARTS}.decoder", GONE, "decoder"),
    (f"{PARTS}.decoder.aircraft.ct1", GONE, "ct1"),
    (f"{PARTS}.decoder.correction", WARM | {"effects": {"temperature": []}}, "0 parameters of temperature"),
    (f"{PARTS}.plausibility.entry_counts", torch.zeros(1, 4), "entry_counts is not on the grid"),
    (f"{PARTS}.context", [COLUMN | {"low": "zero"}], "context column .*zero"),
    (f"{PARTS}.context", [COLUMN | {"code": "x"}], "code"),
    (f"{PARTS}.gaps", GONE, "representation.gaps is of type NoneType; expected a text; .* fit again"),
    (f"{PARTS}.own_mass", {"column": "mass_kg"}, "the representation has 'own_mass'; expected .*seen_flights"),
    (f"{PARTS}.decoder.aircraft.cd2_ld", "=1+1", "coefficient cd2_ld"),
    (f"{PARTS}.decoder.aircraft.vmo_kt", float("nan"), "vmo_kt holds 1 that is no finite number"),
    (f"{PARTS}.decoder.levels_fl", 3, "decoder.levels_fl is of type int; expected a tensor"),
    (f"{PARTS}.decoder.weight_scale", torch.zeros(2), "checkpoint|shape|weight_scale|size"),
    (f"{PARTS}.decoder.cas_basis.components", torch.ones(1, 3), "size|shape|grid"),
    (f"{PARTS}.decoder.residuals.drag", torch.zeros(3, 2), "decoder.residuals is not on the grid"),
    (f"{PARTS}.decoder.residuals.numbers", torch.zeros(3, 2), "decoder.residuals has other flights"),
    (f"{PARTS}.decoder.drag_basis", None, "decoder.drag_basis is of type NoneType; expected a dictionary"),
    (f"{PARTS}.provenance.typecodes", [{"A320": 1}], "typecodes of the provenance"),
    (f"{PARTS}.split.seed", 1 << 64, "split.seed holds 1 that is no finite number"),
]
"""A place in a checkpoint, what is put there, and what is said of it."""


def refused(path: Path, words: str) -> None:
    with pytest.raises(Exception, match=words) as caught:
        load_model(path)
    assert type(caught.value).__module__ == "descentflow.core.errors"
    assert "weights_only" not in str(caught.value), "torch's advice would execute what the file holds"


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("whole")
    fit(toys.write_descents_file(folder / "a320.parquet"), "gaussian", out=folder / "a320.ckpt", final=False)
    return folder / "a320.ckpt"


@pytest.mark.parametrize(("place", "value", "words"), CHANGED)
def test_a_changed_checkpoint_says_what_is_wrong(
    place: str, value: object, words: str, whole: Path, tmp_path: Path
) -> None:
    content = torch.load(whole, weights_only=True)
    *parts, last = place.split(".")
    inside = content
    for part in parts:
        inside = inside[part]
    last = last.replace("_density_loc", "_density.loc")
    if value is GONE:
        del inside[last]
    else:
        inside[last] = value
    torch.save(content, tmp_path / "broken.ckpt")
    refused(tmp_path / "broken.ckpt", words)


def test_a_file_that_is_no_whole_checkpoint_says_what_is_wrong(whole: Path, tmp_path: Path) -> None:
    content, target = whole.read_bytes(), tmp_path / "broken.ckpt"
    loc = torch.load(whole, weights_only=True)["state_dict"]["_density.loc"].numpy().tobytes()
    place = content.index(loc)
    for damaged, words in (
        (content[:-2000], "truncated"),
        (
            content[:place] + bytes([content[place] ^ 1]) + content[place + 1 :],
            "differs from its checksum; expected a whole checkpoint",
        ),
        (b"", "is empty"),
        (b"not a checkpoint", "is no checkpoint; expected a checkpoint of descentflow; .* --simulator"),
        (b"a,b\n1,2\n", "is no checkpoint"),
    ):
        target.write_bytes(damaged)
        refused(target, words)
    with zipfile.ZipFile(whole) as old, zipfile.ZipFile(target, "w", zipfile.ZIP_DEFLATED) as new:
        for name in old.namelist():
            new.writestr(name, old.read(name))
    refused(target, "a compressed archive")
    torch.save({"a": date(2020, 1, 1)}, target)
    refused(target, "holds datetime.date, which could execute code")


def test_no_file(tmp_path: Path) -> None:
    refuses(CheckpointError, "no file", load_model, tmp_path / "absent.ckpt")
    refuses(CheckpointError, r"is a folder.*fit` wrote", load_model, tmp_path)
    for version in ("version_0", "version_1"):
        (tmp_path / version / "checkpoints").mkdir(parents=True)
        (tmp_path / version / "checkpoints" / "best.ckpt").touch()
    refuses(CheckpointError, r"is a folder.* pass .*version_1/checkpoints/best.ckpt", load_model, tmp_path)
    with pytest.raises(CheckpointError, match=r"is a folder.* pass .*version_0/checkpoints/best.ckpt"):
        load_model(tmp_path / "version_0")


@pytest.mark.parametrize("model", [None, 3, [], Gaussian, torch.nn.Linear(2, 2)])
def test_what_holds_no_density_says_what_would(model: object) -> None:
    refuses(ConfigError, "checkpoint, a Density, or a fitted model", as_density, model)


def test_an_unfitted_model_or_density_is_no_model_to_use() -> None:
    refuses(ConfigError, "without a density", as_density, Gaussian())
    refuses(ConfigError, "without a representation", as_density, GaussianDensity(3))


def test_a_model_on_another_device_leaves_the_representation_of_its_data_where_it_is() -> None:
    data = toys.WeightsModule(weights(), weights(100))
    model = Gaussian()
    model.attach(data.representation)
    assert {parameter.device.type for parameter in data.representation.buffers()} == {"cpu"}
    model.to("meta")  # stands for a GPU here
    assert model.density.representation.decoder.levels_fl.device.type == "meta"
    assert data.representation.decoder.levels_fl.device.type == "cpu"
