"""Calls that will probably be asked for, worked out meanwhile by copies of this process."""

from collections.abc import Callable, Hashable, Mapping
from multiprocessing.connection import wait
from typing import Any, Generic, TypeVar

from descentflow.core.side_by_side import Begun, at_once

T = TypeVar("T")


class ForeseenCalls(Generic[T]):
    """Works out calls before they are asked for, as many at the same time as cores are shared by.

    Which calls come next is often known but for what the first of them gives. What is begun and then not wanted took
    a core that would have stood still. Where only one call may run, nothing is begun.

    Example:
        >>> from descentflow.core.side_by_side import cores_shared
        >>> with cores_shared(), ForeseenCalls(lambda key: None) as calls:
        ...     calls.foresee({"six": lambda: 2 * 3, "seven": lambda: 3 + 4})
        ...     calls.ask("six", lambda: 2 * 3), calls.ask("eight", lambda: 2 * 4)
        (6, 8)
    """

    def __init__(self, begins: Callable[[Any], None]) -> None:
        """Begin with none.

        Args:
            begins: Called here with the key of each call when it begins.
        """
        self._begins = begins
        self._waiting: dict[Hashable, Callable[[], T]] = {}
        self._running: dict[Hashable, Begun[T]] = {}
        self._done: dict[Hashable, T] = {}

    def __enter__(self) -> "ForeseenCalls[T]":
        """Itself; nothing that it began is left behind at the end of the block, whatever happens in it."""
        return self

    def __exit__(self, *_: object) -> None:
        self.foresee({})

    def foresee(self, calls: Mapping[Hashable, Callable[[], T]]) -> None:
        """Work these out, the most probable first, and nothing else that was begun."""
        for key in [key for key in self._running if key not in calls]:
            self._running.pop(key).end()
        known = self._running.keys() | self._done.keys()
        self._waiting = {key: call for key, call in calls.items() if key not in known} if at_once() > 1 else {}
        self._fill()

    def ask(self, key: Hashable, call: Callable[[], T]) -> T:
        """What a call gives, worked out here and now unless it was begun.

        Raises:
            Exception: That of the call.
            MemoryError: If the copy that worked it out was killed, as it is where memory runs out.
        """
        while key in self._running:
            ready = wait([begun.pipe for begun in self._running.values()])
            for other in [other for other, begun in self._running.items() if begun.pipe in ready and other != key]:
                self._collect(other)
            if self._running[key].pipe in ready:
                self._done[key] = self._running.pop(key).result()
            self._fill()
        if key in self._done:
            return self._done.pop(key)
        self._waiting.pop(key, None)
        self._begins(key)
        return call()

    def _fill(self) -> None:
        while self._waiting and len(self._running) < at_once():
            key = next(iter(self._waiting))
            self._begins(key)
            self._running[key] = Begun(self._waiting.pop(key))

    def _collect(self, key: Hashable) -> None:
        """Keep what a call gave that was not asked for yet; one that failed fails again once it is."""
        begun = self._running.pop(key)
        try:
            self._done[key] = begun.result()
        except Exception:
            begun.end()
