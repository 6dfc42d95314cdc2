"""Settings that come with the package are found by name from anywhere; a user's own file goes before them."""

from pathlib import Path

import pytest

from descentflow.cli.entry import main
from descentflow.configs.packaged_config import FOLDER, config_file, packaged_configs
from descentflow.core.errors import ConfigError


@pytest.mark.parametrize("name", ["flow", "flow.yaml", "model/flow", "model/flow.yaml", "configs/model/flow.yaml"])
def test_every_spelling_finds_the_file(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    assert config_file(name) == FOLDER / "model" / "flow.yaml"


def test_a_file_of_the_users_goes_first(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("flow.yaml").write_text("model: {}\n")
    assert config_file("flow.yaml") == Path("flow.yaml")


@pytest.mark.parametrize("name", ["floe", "experiment/flow", "elsewhere/configs/model/flow.yaml", "."])
def test_an_unknown_name_is_refused_with_those_that_there_are(name: str) -> None:
    with pytest.raises(ConfigError, match="quickstart"):
        config_file(name)


def test_names_are_used_once() -> None:
    assert len(packaged_configs()) == len(list(FOLDER.rglob("*.yaml")))


def test_prepare_finds_its_thresholds_from_anywhere(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["prepare", "nothing.parquet", "--config", "configs/prepare/default.yaml", "--out", "a.parquet"]) == 2
    assert "nothing.parquet" in capsys.readouterr().err
