"""Settings that come with the package are found by name from anywhere; a user's own file goes before them."""

from pathlib import Path

import pytest

from descentflow.cli.entry import main
from descentflow.configs.packaged_config import config_file
from descentflow.core.errors import ConfigError


@pytest.mark.parametrize("name", ["floe", "experiment/flow", "elsewhere/configs/model/flow.yaml", "."])
def test_an_unknown_name_is_refused_with_those_that_there_are(name: str) -> None:
    with pytest.raises(ConfigError, match="quickstart"):
        config_file(name)


def test_prepare_finds_its_thresholds_from_anywhere(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["prepare", "nothing.parquet", "--config", "configs/prepare/default.yaml", "--out", "a.parquet"]) == 2
    assert "nothing.parquet" in capsys.readouterr().err
