"""End of a command that is interrupted, or to which the system refuses something: in order and with a line."""

import os
import select
import signal
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType
from typing import NoReturn

from descentflow.core.errors import DescentflowError

INTERRUPTED, TERMINATED = 128 + signal.SIGINT, 128 + signal.SIGTERM
"""Exit statuses, as shells have them."""
AGAIN_S = 0.01
"""Seconds until an interruption that was lost comes again."""


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
    usual = threading.excepthook
    threading.excepthook = lambda of_a_thread: _say_of_a_thread(name, of_a_thread, usual)
    with _signals() as received:
        try:
            yield
        except KeyboardInterrupt:
            _end_interrupted(name)
        except BrokenPipeError as error:
            if not _nobody_reads():
                raise _refused(error) from error
            # Whoever read the output has what they wanted (`| head`); Python would write the rest once more at its end.
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
            raise SystemExit(0) from None
        except BaseException as error:
            # Libraries written in C or Rust take the interruption for a failure of theirs, and raise an error in its
            # place; a panic of Rust is no Exception. Lightning's Trainer makes it an end with status 1.
            if signal.SIGINT in received:
                _end_interrupted(name)
            if signal.SIGTERM in received:
                raise SystemExit(TERMINATED) from None
            if isinstance(error, OSError):
                raise _refused(error) from error
            raise
        finally:
            threading.excepthook = usual


@contextmanager
def _signals() -> Iterator[list[int]]:
    """Raise an exception at Ctrl-C and SIGTERM, so that half-written files are removed; gives those that came."""
    received: list[int] = []
    waiting: list[threading.Timer] = []
    main = threading.main_thread()
    if threading.current_thread() is not main:
        yield received
        return

    def interrupt(number: int, frame: FrameType | None) -> None:
        received.append(number)
        raise KeyboardInterrupt

    def terminate(number: int, frame: FrameType | None) -> None:
        received.append(number)
        raise SystemExit(TERMINATED)

    def unraisable(unraised: "sys.UnraisableHookArgs") -> None:
        # It fell into a finalizer, where Python ignores it: the same signal comes once more, after this.
        if sys.platform != "win32" and received and isinstance(unraised.exc_value, KeyboardInterrupt | SystemExit):
            again = threading.Timer(AGAIN_S, signal.pthread_kill, [main.ident, received[-1]])
            waiting.append(again)
            again.start()
        else:
            usual(unraised)

    usual, sys.unraisablehook = sys.unraisablehook, unraisable
    wanted = {signal.SIGTERM: terminate}
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:  # else whoever calls this has a way of their own
        wanted[signal.SIGINT] = interrupt
    before = {number: signal.signal(number, handler) for number, handler in wanted.items()}
    try:
        yield received
    finally:
        for again in waiting:
            again.cancel()
        for number, handler in before.items():
            signal.signal(number, handler)
        sys.unraisablehook = usual


def _nobody_reads() -> bool:
    """Test for a reader of the output that has closed its pipe; workers and servers have pipes, too."""
    if not hasattr(select, "poll"):
        return True  # Windows cannot be asked
    poll = select.poll()
    for output in (1, 2):
        poll.register(output, 0)
    return bool(poll.poll(0))  # errors and hang-ups alone


def _end_interrupted(name: str) -> NoReturn:
    print(f"\ndescentflow {name}: interrupted", file=sys.stderr)
    raise SystemExit(INTERRUPTED) from None


def _refused(error: OSError) -> RefusedBySystemError:
    if isinstance(error, ConnectionError):
        return RefusedBySystemError(
            f"a connection, or a process that the command began, has ended early ({error})",
            expected="that it lasts as long as the command",
            mend="start the command again",
        )
    where = error.filename if error.filename is not None else "a file"
    return RefusedBySystemError(
        f"{where}: {error.strerror or error}",
        expected="permission, and room on the disk, to read and write it",
        mend="choose another file or folder, or change its permissions",
    )


def _say_of_a_thread(name: str, failed: threading.ExceptHookArgs, usual: Callable[..., object]) -> None:
    """A line of what the system refuses to a library's own thread: TensorBoard writes its log in one."""
    if not isinstance(failed.exc_value, OSError):
        usual(failed)
        return
    print(f"descentflow {name}: warning: a log is not whole: {failed.exc_value}", file=sys.stderr)
