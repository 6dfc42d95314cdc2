"""Models as safetensors: the same samples to the bit, and a card that evaluate fills in."""

import json
from pathlib import Path

import pytest
import torch
import toys

import descentflow as df
from descentflow.cli.entry import main
from descentflow.core.errors import CheckpointError, DataError
from descentflow.densities.checkpoint import content_of
from descentflow.exports.export import export
from descentflow.exports.model_card import fill_in_scores

pytestmark = pytest.mark.usefixtures("components_once")

safetensors = pytest.importorskip("safetensors", reason="safetensors is an extra of descentflow")


@pytest.fixture(scope="module")
def descents(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return toys.write_descents_file(tmp_path_factory.mktemp("toys") / "descents.parquet", 200)


@pytest.mark.parametrize("model", ["gaussian", "mixture", "flow", "spline"])
def test_the_same_samples_to_the_bit(descents: Path, tmp_path: Path, model: str) -> None:
    context = {"context": ["entry_fl"]} if model == "flow" else {}
    few = {"max_epochs": 2} if model in ("flow", "spline") else {}
    fitted = df.fit(descents, model=model, **context, **few)
    export(fitted, "safetensors", tmp_path / "model.safetensors")
    given = {"context": {"entry_fl": 320}} if context else {}
    first, again = (df.sample(one, 40, seed=5, **given) for one in (fitted, tmp_path / "model.safetensors"))
    assert torch.equal(first.weights, again.weights)
    for name in ("time_s", "cas_mps", "rate_mps", "drag_n"):
        assert torch.equal(getattr(first.trajectories, name), getattr(again.trajectories, name))


def test_any_program_reads_tensors_and_header(a320: Path, tmp_path: Path) -> None:
    path, card = export(a320, "safetensors", tmp_path / "model.safetensors")
    model = df.load(a320)
    with safetensors.safe_open(path, framework="np") as file:
        header = json.loads(file.metadata()["descentflow"])
        assert header["descentflow"]["representation"]["decoder"]["aircraft"]["typecode"] == "A320"
        stored = file.get_tensor("descentflow.representation.decoder.weight_mean")
        assert (stored == model.representation.decoder.weight_mean.numpy()).all()
    assert set(header) == set(content_of(model))
    assert card.name == "model.md"


def test_every_command_takes_it_and_evaluate_fills_in_the_card(descents: Path, tmp_path: Path, capsys) -> None:
    model = df.fit(descents, model="gaussian")
    path, card = export(model, "safetensors", tmp_path / "model.safetensors")
    text = card.read_text()
    assert "| period | 2026-01-01 to 2026-01-01 |" in text
    assert "Not evaluated yet" in text
    assert main(["info", str(path)]) == 0
    words = ["evaluate", str(path), "--real", str(descents), "--out", str(tmp_path / "e"), "-n", "200", "--no-figures"]
    assert main([*words, "--card", str(card)]) == 0
    capsys.readouterr()
    filled = card.read_text()
    assert "Not evaluated yet" not in filled
    assert "Against 40 held-out flights of descents.parquet" in filled
    assert "| cas_below_transition | wasserstein | kt | " in filled
    assert filled.partition("## Limits")[2] == text.partition("## Limits")[2]
    assert main([*words, "--card", str(card)]) == 0
    assert card.read_text() == filled, "again is the same"
    assert export(model, "safetensors", path) == [path], "a card that was filled in is not overwritten"
    assert card.read_text() == filled
    assert main([*words, "--card", str(tmp_path / "absent.md")]) == 2
    (tmp_path / "other.md").write_text("# notes\n")
    with pytest.raises(DataError, match="without <!-- scores -->"):
        fill_in_scores(tmp_path / "other.md", (), 1, "d.parquet")


def test_a_file_that_is_not_whole_is_refused(a320: Path, tmp_path: Path) -> None:
    path, _ = export(a320, "safetensors", tmp_path / "model.safetensors")
    content = path.read_bytes()
    for name, broken in (("half", content[: len(content) // 2]), ("empty", b""), ("text", b"what is this" * 10)):
        (tmp_path / f"{name}.safetensors").write_bytes(broken)
        with pytest.raises(CheckpointError, match=f"{name}.safetensors"):
            df.load(tmp_path / f"{name}.safetensors")
    from safetensors.torch import save_file

    save_file({"w": torch.ones(2)}, tmp_path / "other.safetensors")
    with pytest.raises(CheckpointError, match=r"other\.safetensors"):
        df.load(tmp_path / "other.safetensors")
