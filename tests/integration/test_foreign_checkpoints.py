"""Checkpoints that somebody else made: no word in them or beside them has a module imported."""

from pathlib import Path

import pytest
import torch
import yaml

import descentflow as df
from descentflow.cli.entry import main

pytestmark = pytest.mark.usefixtures("plain_figures")
COMMANDS = ["validate", "test", "predict"]
FEW = {"test": ["--scores.n_test_samples=200"]}


@pytest.fixture(scope="module")
def fitted(tmp_path_factory: pytest.TempPathFactory, descents: Path) -> bytes:
    path = tmp_path_factory.mktemp("fitted") / "best.ckpt"
    df.fit(descents, "gaussian", out=path)
    return path.read_bytes()


@pytest.fixture
def checkpoint(tmp_path: Path, fitted: bytes, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    path = tmp_path / "sent" / "best.ckpt"
    path.parent.mkdir()
    path.write_bytes(fitted)
    return path


@pytest.fixture
def marker(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """File that is written when the module `sent_module` is imported."""
    found = tmp_path / "marker"
    (tmp_path / "sent_module.py").write_text(f"open({str(found)!r}, 'w').close()\n")
    monkeypatch.syspath_prepend(str(tmp_path))
    return found


def test_a_checkpoint_without_a_run_asks_for_descents(checkpoint: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["validate", "--ckpt_path", str(checkpoint)]) == 2
    assert "--data.descents FILE" in capsys.readouterr().err


@pytest.mark.parametrize("command", COMMANDS)
def test_a_class_that_a_checkpoint_names_is_not_imported(
    checkpoint: Path, marker: Path, descents: Path, command: str
) -> None:
    content = torch.load(checkpoint, weights_only=True)
    content["hyper_parameters"] |= {"_class_path": "sent_module.Model", "_instantiator": "sent_module.make"}
    torch.save(content, checkpoint)
    assert main([command, "--ckpt_path", str(checkpoint), "--data.descents", str(descents), *FEW.get(command, [])]) == 0
    assert not marker.exists()


@pytest.mark.parametrize("command", ["validate", pytest.param("test", marks=pytest.mark.slow), "predict"])
def test_classes_in_settings_beside_a_checkpoint_are_not_imported(
    checkpoint: Path, marker: Path, command: str, descents: Path
) -> None:
    sent = {"class_path": "sent_module.Thing"}
    trainer = {"callbacks": [sent], "logger": sent, "strategy": sent, "plugins": [sent], "profiler": sent}
    settings = {"model": sent, "trainer": trainer, "optimizer": sent, "data": {"descents": str(descents)}}
    (checkpoint.parent / "config.yaml").write_text(yaml.safe_dump(settings))
    assert main([command, "--ckpt_path", str(checkpoint), *FEW.get(command, [])]) == 0
    assert not marker.exists()


@pytest.mark.parametrize(
    "section", [{"class_path": "sent_module.Thing"}, {"context": {"class_path": "sent_module.Thing"}}]
)
def test_a_class_among_the_options_of_data_is_refused(
    checkpoint: Path, marker: Path, descents: Path, section: dict[str, object]
) -> None:
    settings = {"data": {"descents": str(descents), **section}}
    (checkpoint.parent / "config.yaml").write_text(yaml.safe_dump(settings))
    assert main(["validate", "--ckpt_path", str(checkpoint)]) == 2
    assert not marker.exists()
