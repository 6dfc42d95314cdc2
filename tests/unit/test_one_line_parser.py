"""A mistyped option ends in a line, not behind the usage of forty options."""

import pytest

from descentflow.cli import position_arguments
from descentflow.cli.entry import COMMANDS, TRAINER, main
from descentflow.cli.one_line_parser import OneLineParser


@pytest.mark.parametrize("command", sorted(set(COMMANDS) - set(TRAINER)))
@pytest.mark.parametrize("words", [["a.parquet", "--zzzz"], ["a.parquet", "--quiet=3"]])
def test_a_mistake_is_told_in_a_line(command: str, words: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        main([command, *words])
    said = capsys.readouterr().err
    assert ended.value.code == 2
    assert said.count("\n") == 1
    assert said.startswith(f"descentflow {command}: ")
    assert f"see descentflow {command} --help" in said


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (["sample", "m.ckpt", "-n", ""], "-n/--number is ''; expected a whole number; to mend it, see"),
        (["sample", "m.ckpt", "-n", "3", "--seed", "inf"], "--seed is 'inf'; expected a whole number from -2^63 to"),
        (["sample", "m.ckpt", "--end", "x; expected y"], "--end is 'x; expected y'; expected LAT,LON in degrees"),
        (["sample", "m.ckpt", "--track"], "--track without its value; expected one argument;"),
        (["sample", "m.ckpt", "--track", "north"], "--track is 'north'; expected a number;"),
        (["predict-descent", "m.ckpt", "d", "--out", "x"], "no --from-fl; expected what has no default;"),
        (
            ["sample", "m.ckpt", "-n", "10", "--ouput", "a.parquet"],
            "no --out, and no option --ouput is known; expected what has no default; to mend it, try --out, or see",
        ),
        (["export", "m.ckpt", "--ot=json", "--prec", "float64"], "no --to, --out, and no option --ot is known;"),
        (["predict-descent", "m.ckpt", "d", "--from-fl", "9", "--step-s", "-1"], "--step-s is '-1'; expected a num"),
        (["export", "m.ckpt", "--to", "wav", "--out", "x"], "--to is 'wav'; expected one of "),
        (["prepare", "r", "--stale-s", "\ufeff"], "--stale-s is '\\ufeff'; expected a number"),
        (["prepare", "r", "--memory", "much"], "--memory is 'much'; expected a size such as 2GB"),
        (["prepare", "r", "--column", "much"], "--column is 'much'; expected NAME=COLUMN"),
        (["prepare", "r", "--s", "3"], "--s, which begins several; expected one of --"),
        (["simulate", "--quiet=yes"], "--quiet is 'yes'; expected --quiet without a value;"),
    ],
)
def test_a_mistake_is_told_in_three_parts(words: list[str], told: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        main(words)
    said = capsys.readouterr().err
    assert said.startswith(f"descentflow {words[0]}: {told}")
    assert "; to mend it, " in said


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


def test_points_are_read_as_they_are_written() -> None:
    parser = OneLineParser()
    position_arguments.add_arguments(parser)
    args = parser.parse_args(["--route", "-33.5,-70.8", "33.95S,151.18E", "--to-go", "-1"])
    assert args.route == [(-33.5, -70.8), (-33.95, 151.18)]
    assert args.to_go == -1.0


def test_the_nearest_names_are_told(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["prepar", "x"]) == 2
    assert "no command 'prepar'; did you mean prepare? there are simulate, prepare," in capsys.readouterr().err
    with pytest.raises(SystemExit):
        main(["prepare", "rows.parquet", "--out", "d.parquet", "--typcode", "A320"])
    assert "to mend it, try --typecode, or see" in capsys.readouterr().err
