"""Options are the parameters of a command's function; a mistyped one ends in a line, not behind forty others."""

import pytest

from descentflow.cli import trainer_commands
from descentflow.cli.entry import COMMANDS, QUIET, main


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
