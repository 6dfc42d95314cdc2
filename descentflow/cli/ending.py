"""How a command ends that is interrupted, or to which the system refuses something: in order and with a line."""

import os
import signal
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType

from descentflow.core.errors import DescentflowError

INTERRUPTED, TERMINATED = 128 + signal.SIGINT, 128 + signal.SIGTERM
"""Exit statuses, as shells have them."""
REFUSED = "the system refuses"


class RefusedBySystemError(DescentflowError):
    """A file that cannot be read or written for a reason that nobody looked for."""


def print_whatever_comes() -> None:
    """Let standard output and errors show what their encoding lacks as an escape, in place of an error.

    Example:
        >>> print_whatever_comes()
        >>> getattr(sys.stderr, "errors", "backslashreplace")
        'backslashreplace'
    """
    for stream in (sys.stdout, sys.stderr):
        if hasattr(stream, "reconfigure"):
            stream.reconfigure(errors="backslashreplace")


@contextmanager
def ended_in_order(name: str) -> Iterator[None]:
    """Clean up and say a line after Ctrl-C, SIGTERM, a closed pipe or a refusal of the system, in place of a traceback.

    Args:
        name: Of the command.

    Raises:
        RefusedBySystemError: If a file cannot be read or written.
        SystemExit: After an interruption, with the status that shells have for it.

    Example:
        >>> with ended_in_order("sample"):
        ...     raise PermissionError(13, "Permission denied", "samples.parquet")
        Traceback (most recent call last):
        descentflow.cli.ending.RefusedBySystemError: samples.parquet: Permission denied; expected ...; to mend it, ...
    """
    in_main_thread = threading.current_thread() is threading.main_thread()
    before = signal.signal(signal.SIGTERM, _terminate) if in_main_thread else None
    usual = threading.excepthook
    threading.excepthook = lambda of_a_thread: _say_of_a_thread(name, of_a_thread, usual)
    try:
        yield
    except KeyboardInterrupt:
        print(f"\ndescentflow {name}: interrupted", file=sys.stderr)
        raise SystemExit(INTERRUPTED) from None
    except BrokenPipeError:
        # Whoever read the output has what they wanted (`| head`); Python would write the rest once more at its end.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        raise SystemExit(0) from None
    except OSError as error:
        where = error.filename if error.filename is not None else "a file"
        raise RefusedBySystemError(
            f"{where}: {error.strerror or error}",
            expected="permission, and room on the disk, to read and write it",
            mend="choose another file or folder, or change its permissions",
        ) from error
    finally:
        threading.excepthook = usual
        if in_main_thread:
            signal.signal(signal.SIGTERM, before)


def _say_of_a_thread(name: str, failed: threading.ExceptHookArgs, usual: Callable[..., object]) -> None:
    """A line of what the system refuses to a library's own thread: TensorBoard writes its log in one."""
    if not isinstance(failed.exc_value, OSError):
        usual(failed)
        return
    print(f"descentflow {name}: warning: a log is not whole: {failed.exc_value}", file=sys.stderr)


def _terminate(number: int, frame: FrameType | None) -> None:
    """End by an exception, so that what is half written is removed."""
    raise SystemExit(TERMINATED)
