"""Independent calls worked out at the same time, by copies of this process, with the same results as one by one.

Fits of a few hundred flights are made of thousands of small steps: threads would wait for each other, and new processes
would load torch and the flights for longer than a fit takes. A copy (``fork``) has both at once; it uses one thread, as
torch's own data loaders do, and sends back what it worked out.
"""

import os
import sys
import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from functools import partial
from multiprocessing.connection import wait
from typing import Any, Generic, TypeVar

import torch

from descentflow.core.forked import answered, forked, give_way, killed, received

T = TypeVar("T")
MOST = 4
"""Copies at once at most: each takes memory for what it changes."""
_allowed = 1
_beside: list["Begun[Any]"] = []
"""Calls that have a core of their own while they work."""


@contextmanager
def cores_shared() -> Iterator[None]:
    """Let calls inside the block use as many processes as torch has threads, and torch one thread in each.

    Without fork (Windows, macOS), outside the main thread, or where torch has one thread, calls follow each other.

    Example:
        >>> with cores_shared():
        ...     side_by_side([lambda: 1 + 1, lambda: 2 * 3]), torch.get_num_threads()
        ([2, 6], 1)
    """
    global _allowed
    before, threads = _allowed, torch.get_num_threads()
    can = sys.platform == "linux" and threading.current_thread() is threading.main_thread()
    _allowed = min(threads, len(os.sched_getaffinity(0)), MOST) if can and before == 1 else before
    torch.set_num_threads(1)
    try:
        yield
    finally:
        _allowed = before
        torch.set_num_threads(threads)


class Begun(Generic[T]):
    """A call that a copy of this process works out meanwhile; worked out when asked for, where only one may run.

    Example:
        >>> with Begun(lambda: 6 * 7) as begun:
        ...     begun.result()
        42
    """

    def __init__(
        self, call: Callable[[], T], *, own_core: bool = False, gives_way: bool = False, held: bool = False
    ) -> None:
        """Begin.

        Args:
            call: What to work out; its result must be one that pickle takes, and what it changes is not seen here.
                It must not use polars, whose threads do not live on in a copy: it would wait for them for ever.
            own_core: Whether it has one of the cores while it works, in a ``with`` block: others share what is left.
                For long calls.
            gives_way: Whether others have more of the cores, where all are wanted: its result is asked for much later.
            held: Whether the copy is made now, of what this process is now, and begins when :meth:`start` says so.
        """
        self._call, self._own_core = call, own_core
        self._process: Any = None
        self._sent: bytes | None = None
        self._held = held
        # Readable once it is done; nothing where the call waits until it is asked for.
        self.pipe: Any = None
        if _allowed > 1:
            self._process, self.pipe = forked(partial(_send_once, call, gives_way=gives_way, held=held))

    @property
    def is_held(self) -> bool:
        """Whether it waits for its start."""
        return self._held

    def start(self) -> None:
        """Begin what was held."""
        self._held = False
        if self.pipe is not None:
            # A copy that was killed is found when it is asked.
            with suppress(ConnectionError):
                self.pipe.send_bytes(b"")

    def __enter__(self) -> "Begun[T]":
        """Itself; nothing of it is left behind at the end of the block, whatever happens in it."""
        if self._own_core:
            _beside.append(self)
        return self

    def __exit__(self, *_: object) -> None:
        if self._own_core:
            _beside.remove(self)
        self.end()

    @property
    def works(self) -> bool:
        """Whether a copy is at work. One that has done it is received from: until then it could not end."""
        if self._process is None or self._held or self._sent is not None:
            return False
        if self.pipe.poll():
            self._receive()
            return False
        return bool(self._process.is_alive())

    def result(self) -> T:
        """What was worked out.

        Raises:
            Exception: That of the call.
            MemoryError: If the copy was killed, as it is where memory runs out.
        """
        if self.pipe is None:
            return self._call()
        if self._held:
            self.start()
        if self._sent is None:
            self._receive()
        if not self._sent:
            raise killed(self._process)
        self.end()
        found: T = received(self._sent)
        return found

    def _receive(self) -> None:
        """Keep what the copy sends, or nothing of it where it was killed; waits for it."""
        try:
            self._sent = self.pipe.recv_bytes()
        except EOFError:
            self._sent = b""

    def end(self) -> None:
        """Leave nothing of it behind."""
        if self.pipe is not None:
            self._process.terminate()
            self._process.join()
            self.pipe.close()


def is_shared() -> bool:
    """Whether copies of this process may work beside it, be it that they all have work now.

    Example:
        >>> is_shared()
        False
    """
    return _allowed > 1


def at_once() -> int:
    """How many calls are worked out at the same time, beside those that have a core of their own.

    Example:
        >>> at_once()
        1
        >>> with cores_shared(), Begun(lambda: 1, own_core=True):
        ...     at_once()
        1
    """
    return max(_allowed - sum(one.works for one in _beside), 1)


def pipes_beside() -> list[Any]:
    """Pipes of the calls that have a core of their own now: one is readable once its call has ended.

    Example:
        >>> import time
        >>> with cores_shared(), Begun(lambda: time.sleep(60), own_core=True):
        ...     len(pipes_beside()) if is_shared() else 1
        1
    """
    return [one.pipe for one in _beside if one.works]


def side_by_side(calls: Sequence[Callable[[], T]], begins: Callable[[int], None] = lambda place: None) -> list[T]:
    """Results of independent calls in their order, the first error raised.

    Args:
        calls: What to work out, see :class:`Begun`.
        begins: Called here with the place of each call when it begins.

    Example:
        >>> side_by_side([lambda: 1, lambda: 2])
        [1, 2]
    """
    if at_once() < 2 or len(calls) < 2:
        found = []
        for place, call in enumerate(calls):
            begins(place)
            found.append(call())
        return found
    running: dict[Any, tuple[int, Begun[T]]] = {}
    done: dict[int, T] = {}
    waiting = list(enumerate(calls))[::-1]
    try:
        while waiting or running:
            while waiting and len(running) < at_once():
                place, call = waiting.pop()
                begins(place)
                begun = Begun(call)
                running[begun.pipe] = place, begun
            for pipe in wait(list(running)):
                place, begun = running[pipe]
                done[place] = begun.result()
                del running[pipe]
    finally:
        for _, begun in running.values():
            begun.end()
    return [done[place] for place in range(len(calls))]


def _send_once(call: Callable[[], object], pipe: Any, *, gives_way: bool, held: bool) -> None:
    if held:
        try:
            pipe.recv_bytes()
        except EOFError:
            return
    if gives_way:
        give_way()
    pipe.send_bytes(answered(call))


def _alone() -> None:
    """In a copy of this process: one thing after another, and nothing of what this one has begun."""
    global _allowed
    _allowed = 1
    _beside.clear()


if sys.platform == "linux":
    os.register_at_fork(after_in_child=_alone)
