"""A mistyped option ends in a line, not behind the usage of forty options."""

import pytest

from descentflow.cli.entry import COMMANDS, TRAINER, main


@pytest.mark.parametrize("command", sorted(set(COMMANDS) - set(TRAINER)))
@pytest.mark.parametrize("words", [["a.parquet", "--zzzz"], ["a.parquet", "--quiet=3"]])
def test_a_mistake_is_told_in_a_line(command: str, words: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        main([command, *words])
    said = capsys.readouterr().err
    assert ended.value.code == 2
    assert said.count("\n") == 1
    assert said.startswith(f"descentflow {command}: ")
    assert f"descentflow {command} --help lists all options" in said


def test_the_nearest_names_are_told(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["prepar", "x"]) == 2
    assert "no command 'prepar'; did you mean prepare? there are simulate, prepare," in capsys.readouterr().err
    with pytest.raises(SystemExit):
        main(["prepare", "rows.parquet", "--out", "d.parquet", "--typcode", "A320"])
    assert "did you mean --typecode?" in capsys.readouterr().err
