"""Words of a command line: mistyped options, names of settings, and bytes that are no letters."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from descentflow.cli import trainer_commands
from descentflow.cli.entry import COMMANDS, QUIET, main
from descentflow.configs.packaged_config import config_file
from descentflow.core.errors import ConfigError
from descentflow.surveillance.prepare import prepare


@pytest.mark.parametrize("command", sorted(set(COMMANDS) - set(trainer_commands.COMMANDS)))
@pytest.mark.parametrize("words", [["a.parquet", "--zzzz"], ["a.parquet", "--quiet=3"]])
def test_a_mistake_is_told_in_a_line(command: str, words: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        main([command, *words, QUIET])  # on a slow machine progress would be shown
    said = capsys.readouterr().err
    assert ended.value.code == 2
    assert said.count("\n") == 1
    assert said.startswith(f"descentflow {command}: ")
    assert f"see descentflow {command} --help" in said


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["sample", "m.ckpt", "-n", ""], "argument -n/--number: invalid int value: ''; expected arguments as"),
        (["sample", "m.ckpt", "--end", "x; expected y"], "'x; expected y'; expected LAT,LON in degrees"),
        (["sample", "m.ckpt", "--track"], "argument --track: expected one argument"),
        (["predict-descent", "m.ckpt", "d", "--out", "x"], "the following arguments are required: --from-fl"),
        (["prepare", "r", "--stale-s", "\ufeff"], "argument --stale-s: invalid float value: '\\ufeff'"),
        (["prepare", "r", "--memory", "much"], "'much'; expected a size such as 2GB"),
        (["prepare", "r", "--s", "3"], "ambiguous option: --s could match --"),
        (["simulate", "--out", ""], "argument --out: an empty path"),
        (["simulate", "--quiet=yes"], "argument --quiet: ignored explicit argument 'yes'"),
    ],
)
def test_a_mistake_is_named_with_what_was_got(words: list[str], message: str, capsys) -> None:
    with pytest.raises(SystemExit):
        main(words)
    shown = capsys.readouterr().err
    assert shown.startswith(f"descentflow {words[0]}: ")
    assert message in shown


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["prepare", "r", "--out", "d.parquet", "--column", "much"], "--column much; expected NAME=VALUE"),
        (["prepare", "r", "--out", "d.parquet", "--column", "IAS=a", "IAS=b"], "each name once"),
    ],
)
def test_words_that_the_command_cannot_use_are_refused(words: list[str], message: str, capsys) -> None:
    assert main(words) == 2
    assert message in capsys.readouterr().err


@pytest.mark.parametrize(
    "words",
    [
        ["--end", "-33.95,151.18", "--track", "270"],
        ["--end=-33.95,151.18", "--track", "9e1"],
        ["--end", "33.95S,151.18E", "--track", "270", "--to-go", "9e-1"],
        ["--route", "-33.5,-70.8", "-33.4,-70.79"],
    ],
)
def test_southern_and_western_points_are_no_options(words: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["sample", "no.ckpt", "-n", "1", "--out", "samples.parquet", *words]) == 2
    assert "no file no.ckpt" in capsys.readouterr().err


def test_the_nearest_command_is_named(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["prepar", "x"]) == 2
    assert "no command 'prepar'; did you mean prepare? there are simulate, prepare," in capsys.readouterr().err


def test_letters_that_the_locale_lacks_ask_for_another_locale() -> None:
    """A process in the plain C locale: the file has its right name, so renaming it would be no help."""
    bare = {"LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"}
    words = [sys.executable, "-W", "ignore", "-m", "descentflow", "info", "é.ckpt".encode()]
    done = subprocess.run(words, capture_output=True, check=False, env={**os.environ, **bare})
    assert done.returncode == 2
    assert b"PYTHONUTF8=1 if the locale lacks such letters" in done.stderr


def test_bytes_that_are_no_letters_ask_for_another_name(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["info", os.fsdecode(b"\xff.ckpt")]) == 2
    assert "rename the file" in capsys.readouterr().err


def test_a_folder_with_such_a_name_is_refused(tmp_path: Path) -> None:
    try:
        (tmp_path / os.fsdecode(b"h\xf6he.csv")).write_text("timestamp,icao24,altitude,IAS,Mach\n")
    except OSError:
        pytest.skip("this file system takes names in UTF-8 only")
    with pytest.raises(ConfigError, match=r"h\\udcf6he.csv'; expected words and names of files in UTF-8"):
        prepare(tmp_path)


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
