"""Outcome of a case: accepted with every row accounted for, refused in a sentence, or a defect."""

import contextlib
import io
import itertools
import json
import os
import signal
import tempfile
import traceback
import warnings
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from types import FrameType

from descentflow.aircraft_types.registry import aircraft
from descentflow.cli.entry import main
from descentflow.core.errors import DescentflowError
from descentflow.diagnosis.findings.read_gap import read_gap
from fuzzing import loggers, wrong_arguments
from fuzzing.cases import CODE_RAN, Case
from fuzzing.weather_changes import wrong_values

SECONDS = 30
"""Of processor time, so that a busy machine makes no defect of a fit."""
WAITING_S = 150
"""In all: what waits for something that never comes uses no processor."""
OF_FAILED_FIT = ("config.yaml", "events.out.tfevents")
"""Beginnings of files that a failed fit leaves: settings, which the next run there writes again, and its log."""
PARTS = ("; expected ", "; to mend it, ")


@dataclass(frozen=True)
class Outcome:
    """Outcome of a case.

    Attributes:
        verdict: ``accepted``, ``refused``, or what kind of defect it is.
        words: The message, or what is wrong.
    """

    verdict: str
    words: str = ""


class TooLong(BaseException):
    """Raised when a case has had its seconds; no `except Exception` catches it."""


def judged(case: Case, folder: Path) -> Outcome:
    """Run a case and say how it ended.

    Args:
        case: What to run.
        folder: Its own, in which it may write.
    """
    before = {path.name for path in folder.iterdir()}
    out, err = io.StringIO(), io.StringIO()
    try:
        with (
            _in(folder),
            _seconds(SECONDS),
            _terminal() as chatter,
            contextlib.redirect_stdout(out),
            contextlib.redirect_stderr(err),
        ):
            warnings.simplefilter("ignore")
            status = _run(case.words, err)
    except TooLong:
        return Outcome("over the time", f"{SECONDS} s of processor time, or {WAITING_S} s in all")
    except MemoryError:
        return Outcome("memory", traceback.format_exc()[-2000:])
    except BaseException:  # a command never ends in one: this is what is looked for
        return Outcome("traceback", traceback.format_exc()[-3000:])
    if case.kind == "weather" and ("Traceback" in err.getvalue() or chatter):
        return Outcome("a library's words on the terminal", (err.getvalue() + "".join(chatter))[-1000:])
    if touched := [name for name in case.others if not _is_as_it_was(folder / name, name)]:
        return Outcome("file of others lost", ", ".join(touched))
    left = {path.name for path in folder.iterdir()} - before
    if CODE_RAN in left:
        return Outcome("code of a file was run", " ".join(case.words))
    if case.others:
        left = {path.name for path in folder.rglob("*") if path.is_file()} - {Path(name).name for name in case.others}
        left -= {loggers.STORE} if status else left
    if status == 0:
        return _accepted(case, folder, left)
    return _refused(case, err.getvalue(), left)


def _run(words: list[str], err: io.StringIO) -> int:
    """Exit status of a command, or of a function that a command calls after minutes of other work."""
    if words[0] not in ("call", "argument"):
        try:
            return main(words)
        except SystemExit as end:  # argparse's own way
            return int(end.code or 0)
    try:
        if words[0] == "argument":
            wrong_arguments.run(Path(words[1]), *words[2:])
        elif words[1] == "aircraft":
            aircraft(words[2], Path(words[3]))
        elif words[1] == "weather":
            wrong = wrong_values(Path(words[2]), int(words[3]))
            assert not (wrong and words[4] == "exact"), wrong
        else:
            read_gap(words[2])
    except DescentflowError as error:
        print(f"descentflow {words[1]}: {error}", file=err)
        return 2
    return 0


def _accepted(case: Case, folder: Path, left: set[str]) -> Outcome:
    if stray := _temporary(left):
        return Outcome("temporary file left", ", ".join(stray))
    if case.out is not None and not case.out.exists():
        return Outcome("no output", " ".join(case.words))
    report = folder / "report.json"
    return _kept_or_counted(report, case.rows) if report.is_file() else Outcome("accepted")


def _kept_or_counted(report: Path, rows: int | None) -> Outcome:
    """Test that each step's rows are those of the step before less what it dropped, beginning with all."""
    steps = json.loads(report.read_text())["report"]["steps"]
    read = steps[0]["rows_left"] + steps[0]["rows_dropped"]
    if rows is not None and read != rows:
        return Outcome("rows lost in silence", f"{rows} rows given, {read} told")
    for before, after in itertools.pairwise(steps):
        if before["rows_left"] - after["rows_dropped"] != after["rows_left"]:
            return Outcome("rows lost in silence", f"{before} then {after}")
    return Outcome("accepted")


def _refused(case: Case, said: str, left: set[str]) -> Outcome:
    if stray := {name for name in left if not name.startswith(OF_FAILED_FIT)}:
        return Outcome("file left by a refusal", ", ".join(sorted(stray)))
    own = [line for line in said.splitlines() if line.startswith("descentflow ") and ": warning: " not in line]
    if not own:
        return Outcome("no message", said[-500:])
    if not all(part in said for part in PARTS):
        return Outcome("message without got, expected and mend", said[-500:])
    if len(said) > 20_000:
        return Outcome("message of pages", f"{len(said)} characters")
    return Outcome("refused", own[-1][:300])


def _is_as_it_was(path: Path, name: str) -> bool:
    return path.is_file() and path.read_text() == name


def _temporary(names: set[str]) -> list[str]:
    return sorted(name for name in names if name.startswith("."))


@contextlib.contextmanager
def _in(folder: Path) -> Iterator[None]:
    before = Path.cwd()
    os.chdir(folder)
    try:
        yield
    finally:
        os.chdir(before)


@contextlib.contextmanager
def _terminal() -> Iterator[list[str]]:
    """Text that libraries of C write to the terminal meanwhile, known at the end."""
    written: list[str] = []
    own = os.dup(2)
    with tempfile.TemporaryFile() as file:
        os.dup2(file.fileno(), 2)
        try:
            yield written
        finally:
            os.dup2(own, 2)
            os.close(own)
            file.seek(0)
            written.extend(filter(None, [file.read().decode(errors="replace")]))


@contextlib.contextmanager
def _seconds(limit: int) -> Iterator[None]:
    def stop(number: int, frame: FrameType | None) -> None:
        raise TooLong

    signals = {signal.SIGALRM: (signal.ITIMER_REAL, WAITING_S), signal.SIGPROF: (signal.ITIMER_PROF, limit)}
    before = {number: signal.signal(number, stop) for number in signals}
    for timer, seconds in signals.values():
        signal.setitimer(timer, seconds)
    try:
        yield
    finally:
        for number, (timer, _) in signals.items():
            signal.setitimer(timer, 0)
            signal.signal(number, before[number])
