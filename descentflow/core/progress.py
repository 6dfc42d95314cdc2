"""Progress of a long call, on stderr: a line that updates on a terminal or in a notebook, elsewhere plain lines.

Nothing is shown in the first two seconds. A command opens one :func:`display`; whatever takes long, there or in the
library, reports it by :func:`stage`. Standard output is never written to.
"""

import shutil
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager, nullcontext, suppress
from dataclasses import dataclass, field
from threading import Event, Lock, Thread
from time import monotonic

AFTER_S = 2.0
"""Seconds before anything is shown: shorter work needs no line."""
REDRAWN_S = 0.25
"""Seconds between two states of the line on a terminal: the least that reads as a clock that runs."""
LINE_S = 10.0
"""Seconds between two plain lines, as in the log of a batch job: an hour makes 360 of them."""
CLEARED = "\r\x1b[2K"
"""Control sequence that empties a terminal's line; notebooks know `\\r` alone."""


@dataclass(eq=False)
class Stage:
    """Stage of a long call, and its share done.

    Attributes:
        text: In a few words.
        total: How much there is to do, in units; None if that is not known.
        unit: The things counted, in the plural.
        done: How much has been done.
    """

    text: str
    total: int | None = None
    unit: str = ""
    done: int = 0
    began: float = field(default_factory=monotonic, repr=False)

    def advance(self, n: int = 1) -> None:
        """Count what has been done since the last call."""
        self.done += n

    def expect(self, total: int) -> None:
        """Say how much there is to do, once it is known."""
        self.total = total

    def say(self, text: str) -> None:
        """Go on to the next work, a step further."""
        self.text, self.unit = text, self.unit or "steps"
        self.done += 1

    def part(self, text: str, total: int | None = None, unit: str = "") -> Callable[[int], None]:
        """A progress callback for a part of the stage, which is shown as soon as the callback is called."""
        own = Stage(text, total, unit, began=0.0)

        def advance(n: int = 1) -> None:
            own.began = own.began or monotonic()
            own.done += n
            self.text, self.total, self.unit, self.done, self.began = text, total, unit, own.done, own.began

        return advance

    def as_text(self) -> str:
        """One plain line, without what it is a stage of."""
        counted = ""
        if self.total:
            share = f"({100 * self.done // self.total} %)"
            counted = ", " + " ".join(filter(None, [f"{self.done:,} of {self.total:,}", self.unit, share]))
        elif self.done:
            counted = f", {self.done:,} {self.unit or 'steps'}"
        return f"{self.text}{counted}, {monotonic() - self.began:.0f} s"

    def as_meter(self, name: str) -> str:
        """A line with a bar for the terminal, as wide as that is; of ASCII alone where it knows no others."""
        from tqdm import tqdm

        columns = shutil.get_terminal_size().columns - 1
        if not self.total:
            return f"{name}: {self.as_text()}"[:columns]
        line: str = tqdm.format_meter(
            self.done,
            self.total,
            monotonic() - self.began,
            ncols=columns,
            prefix=f"{name}: {self.text}",
            unit=f" {self.unit}",
            ascii=not (getattr(sys.stderr, "encoding", None) or "").lower().startswith("utf"),
            bar_format="{desc}: {percentage:3.0f}%|{bar}| {n_fmt}/{total_fmt}{unit} [{elapsed}<{remaining}]",
        )
        return line


class _Display:
    """Draws the innermost stage from a thread of its own, so that the clock runs while nothing is counted."""

    def __init__(self, name: str) -> None:
        self.name, self.stages = name, [Stage("starting")]
        self.drawn, self.over, self.lock = False, Event(), Lock()

    def run(self, wait: float) -> None:
        while not self.over.wait(wait):
            terminal = _is_terminal()
            wait = REDRAWN_S if terminal else LINE_S
            stage = self.stages[-1]
            text = _cleared() + stage.as_meter(self.name) if terminal else f"{self.name}: {stage.as_text()}\n"
            with self.lock:
                self._write(text, drawn=terminal)

    def clear(self) -> None:
        with self.lock:
            if self.drawn:
                self._write(_cleared(), drawn=False)

    def _write(self, text: str, *, drawn: bool) -> None:
        self.drawn = drawn
        # Whoever closed stderr, or cannot show a letter, wants no line; the work goes on.
        with suppress(OSError, ValueError, AttributeError):
            sys.stderr.write(text)
            sys.stderr.flush()


_shown: list[_Display] = []
"""The one display, if there is any."""


def _is_terminal() -> bool:
    """Test for a stderr whose last line can be written anew."""
    try:
        return _is_notebook() or sys.stderr.isatty()
    except (AttributeError, ValueError):
        return False


def _is_notebook() -> bool:
    return type(sys.stderr).__module__.startswith("ipykernel.")


def _cleared() -> str:
    blank = " " * (shutil.get_terminal_size().columns - 1)
    return f"\r{blank}\r" if _is_notebook() else CLEARED


@contextmanager
def display(name: str, *, quiet: bool = False, after_s: float = AFTER_S) -> Iterator[None]:
    """Show the stages inside the block on stderr. Inside another display it is a stage of that one."""
    if _shown:
        with stage(name):
            yield
        return
    whole = _Display(name)
    thread = Thread(target=whole.run, args=[after_s], daemon=True, name="progress")
    _shown.append(whole)
    if not quiet:
        thread.start()
    try:
        yield
    finally:
        _shown.remove(whole)
        whole.over.set()
        if not quiet:
            thread.join()
        whole.clear()


@contextmanager
def stage(text: str, total: int | None = None, unit: str = "") -> Iterator[Stage]:
    """Name the work inside the block; shown by the display around it, or by one of its own."""
    with nullcontext() if _shown else display("descentflow"):
        current, whole = Stage(text, total, unit), _shown[0]
        whole.stages.append(current)
        try:
            yield current
        finally:
            whole.stages.remove(current)
            whole.clear()  # what follows may print


def clear_line() -> None:
    """Empty the line that is shown on a terminal, before something else is written there."""
    for whole in _shown:
        whole.clear()
