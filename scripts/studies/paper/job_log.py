"""Log of what a job of a study prints, next to its files."""

import logging
import sys
from collections.abc import Iterator
from contextlib import contextmanager, redirect_stderr, redirect_stdout
from pathlib import Path
from typing import TextIO

from descentflow.core.errors import DescentflowError


@contextmanager
def logged_to(log: Path) -> Iterator[None]:
    """Send what is printed into a log, and what Lightning logs, whose handlers keep the stream they were made with.

    An error that is raised on purpose is written into the log too, and raised again.

    Args:
        log: The file; one that is there is overwritten.

    Example:
        >>> with logged_to(Path("job.log")):
        ...     print("fitted")
        >>> Path("job.log").read_text().split()
        ['fitted']
    """
    with log.open("w") as file, redirect_stdout(file), redirect_stderr(file):
        before = [(handler, handler.setStream(file)) for handler in _handlers()]
        try:
            yield
        except DescentflowError as error:
            print(error)
            raise
        finally:
            kept = dict(before)
            for handler in _handlers():
                # One that was made in here, as Lightning was imported, has no stream from before.
                stream = kept.get(handler) or sys.__stderr__
                if stream is not None:
                    handler.setStream(stream)


def _handlers() -> list[logging.StreamHandler[TextIO]]:
    loggers = [logging.getLogger(name) for name in ("lightning", "lightning.pytorch", "lightning.fabric")]
    # Not its subclasses: these write to files, or keep what is logged for a test, and have streams of their own.
    return [h for logger in loggers for h in logger.handlers if type(h) is logging.StreamHandler]
