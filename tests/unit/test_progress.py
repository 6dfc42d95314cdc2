"""Progress of a long call: on stderr alone, after a while, and not at all with --quiet."""

import io
from collections.abc import Callable
from functools import partial
from time import sleep
from types import SimpleNamespace

import pytest

from descentflow.cli import entry, main
from descentflow.core import progress
from descentflow.core.progress import CLEARED, display, stage


class Terminal(io.StringIO):
    encoding = "utf-8"

    def isatty(self) -> bool:
        return True


Notebook = type("OutStream", (io.StringIO,), {"__module__": "ipykernel.iostream", "encoding": "utf-8"})
"""As a kernel's stderr: no terminal, and its cells know ``\\r`` and no control sequence."""


def show_on(stream: io.StringIO, monkeypatch: pytest.MonkeyPatch) -> None:
    """Not `sys.stderr` itself, which pytest puts back between a fixture and its test."""
    monkeypatch.setattr(progress, "sys", SimpleNamespace(stderr=stream))


def wait_for(shown: Callable[[], bool]) -> None:
    """Until the drawing thread has come round; twenty seconds are for a machine that is busy with other things."""
    for _ in range(2000):
        if shown():
            return
        sleep(0.01)
    raise AssertionError("nothing was shown")


@pytest.fixture
def terminal(monkeypatch: pytest.MonkeyPatch) -> Terminal:
    stream = Terminal()
    show_on(stream, monkeypatch)
    monkeypatch.setattr(progress, "REDRAWN_S", 0.001)
    return stream


@pytest.fixture
def log(monkeypatch: pytest.MonkeyPatch) -> io.StringIO:
    stream = io.StringIO()
    show_on(stream, monkeypatch)
    monkeypatch.setattr(progress, "LINE_S", 0.001)
    return stream


def test_a_log_gets_plain_lines_of_what_is_done_and_how_much(log: io.StringIO) -> None:
    with display("descentflow sample", after_s=0.0), stage("drawing", total=200, unit="descents") as drawn:
        drawn.advance(50)
        wait_for(lambda: "50 of 200" in log.getvalue())
    line = next(line for line in log.getvalue().splitlines() if "50 of 200" in line)
    assert line.startswith("descentflow sample: drawing, 50 of 200 descents (25 %), ")
    assert "\r" not in log.getvalue()
    assert "\x1b" not in log.getvalue()


def test_a_terminal_gets_one_line_that_is_emptied_before_anything_is_printed(terminal: Terminal) -> None:
    with display("descentflow sample", after_s=0.0):
        with stage("drawing", total=200, unit="descents") as drawn:
            drawn.advance(50)
            wait_for(lambda: "50/200" in terminal.getvalue())
        shown = terminal.getvalue()
        assert shown.endswith(CLEARED)
    assert "\n" not in shown
    assert " 25%|" in shown


def test_quiet_is_quiet_for_all_that_is_called(log: io.StringIO) -> None:
    with display("sample", quiet=True, after_s=0.0), stage("drawing"), display("inside", after_s=0.0), stage("more"):
        sleep(0.05)
    assert log.getvalue() == ""


def test_a_library_call_shows_itself_without_a_command(log: io.StringIO, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(progress, "display", partial(display, after_s=0.0))
    with stage("reading descents"):
        wait_for(lambda: "descentflow: reading descents" in log.getvalue())
    assert not progress._shown


@pytest.mark.parametrize("words", [[], ["--quiet"]])
def test_a_command_shows_its_stages_unless_it_is_to_be_quiet(
    words: list[str], tmp_path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(entry, "display", partial(display, after_s=0.0))
    monkeypatch.setattr(progress, "LINE_S", 0.001)
    assert main(["simulate", "--flights", "12", "--out", str(tmp_path / "rows.parquet"), *words]) == 0
    said = capsys.readouterr()
    assert ("of 12 flights" in said.err) == (not words)
    assert not words or said.err == ""
    assert "wrote" in said.out
    assert "of 12 flights (" not in said.out


def test_a_notebook_has_one_line_that_updates_and_goes(monkeypatch: pytest.MonkeyPatch) -> None:
    stream = Notebook()
    show_on(stream, monkeypatch)
    monkeypatch.setattr(progress, "REDRAWN_S", 0.001)
    with display("descentflow sample", after_s=0.0), stage("drawing", total=200, unit="descents") as drawn:
        drawn.advance(50)
        wait_for(lambda: "50/200" in stream.getvalue())
    assert "\n" not in stream.getvalue()
    assert "\x1b" not in stream.getvalue()
    assert stream.getvalue().rpartition("\r")[0].rpartition("\r")[2].isspace(), "the line is blank in the end"
