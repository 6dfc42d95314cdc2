"""A copy of this process, and what goes between the two: calls' results, errors, and word of a copy that was killed."""

import os
import pickle
import signal
import traceback
import warnings
from collections.abc import Callable
from contextlib import suppress
from multiprocessing import get_context
from typing import Any

import torch

LESS_URGENT = 10
"""Niceness that a copy adds whose result is asked for late: a tenth of the share of others. With 19, which leaves it a
hundredth, it would not end where other programs keep all cores busy."""


def forked(work: Callable[[Any], None]) -> tuple[Any, Any]:
    """A copy of this process, and the pipe that leads to it.

    Args:
        work: What the copy does, given its end of the pipe; then it ends.

    Example:
        >>> process, pipe = forked(lambda pipe: pipe.send("here"))
        >>> pipe.recv(), process.join(), process.exitcode
        ('here', None, 0)
    """
    context = get_context("fork")
    ours, theirs = context.Pipe()
    process = context.Process(target=_work, args=(work, ours, theirs), daemon=True)
    with warnings.catch_warnings():
        # Python 3.12 warns of fork beside threads, which may hold locks: the copy runs plain torch and no thread's.
        warnings.simplefilter("ignore", DeprecationWarning)
        # Ctrl-C waits until the copy knows what to do with it.
        signal.pthread_sigmask(signal.SIG_BLOCK, [signal.SIGINT])
        try:
            process.start()
        finally:
            signal.pthread_sigmask(signal.SIG_UNBLOCK, [signal.SIGINT])
    theirs.close()
    return process, ours


def give_way() -> None:
    """In a copy of this process: leave most of the cores to others that want them.

    Example:
        >>> from descentflow.core.side_by_side import Begun, cores_shared, is_shared
        >>> with cores_shared(), Begun(lambda: os.nice(0), gives_way=True) as begun:
        ...     (begun.result() if is_shared() else os.nice(0) + 10) - os.nice(0)
        10
    """
    os.nice(LESS_URGENT)


def _work(work: Callable[[Any], None], theirs: Any, pipe: Any) -> None:
    """In the copy: one thread, and no Ctrl-C of its own."""
    # The end that is read: while this process had it too, nothing would tell that nobody reads any more.
    theirs.close()
    # Ctrl-C reaches the whole group; the one that was asked ends the others, where it does not ignore it itself.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.pthread_sigmask(signal.SIG_UNBLOCK, [signal.SIGINT])
    torch.set_num_threads(1)
    # Nobody reads what is sent where the one that asked has ended, or wants it no more.
    with suppress(ConnectionError):
        work(pipe)
    pipe.close()


def answered(call: Callable[[], object]) -> bytes:
    """What a call gives, or its error, as a copy of a process sends it.

    Example:
        >>> received(answered(lambda: 6 * 7))
        42
    """
    try:
        sent: tuple[bool, object] = (True, call())
    except Exception as error:
        error.add_note("".join(traceback.format_exception(error)))
        sent = (False, error)
    return pickle.dumps(sent)


def received(sent: bytes) -> Any:
    """What :func:`answered` was given, or its error raised.

    Example:
        >>> try:
        ...     received(answered(lambda: 1 // 0))
        ... except ZeroDivisionError as error:
        ...     print(error)
        integer division or modulo by zero
    """
    # Plain pickle: torch's own would leave tensors in memory of a process that has ended.
    done, value = pickle.loads(sent)
    if not done:
        raise value
    return value


def killed(process: Any) -> MemoryError:
    """The error that says so of a copy which ended before it sent what was asked of it.

    Example:
        >>> process, _ = forked(lambda pipe: None)
        >>> "lack of memory" in str(killed(process))
        True
    """
    process.join()
    return MemoryError(
        f"a process that worked for this one ended with status {process.exitcode}, which is mostly for "
        "lack of memory: OMP_NUM_THREADS=1 does one thing after another"
    )
