"""Answers that will probably be asked for, worked out meanwhile by copies of this process."""

from collections.abc import Callable, Hashable, Mapping
from multiprocessing.connection import wait
from typing import Any, Generic, TypeVar

from descentflow.core.side_by_side import at_once, is_shared, pipes_beside
from descentflow.core.worker import Worker

Q = TypeVar("Q")
T = TypeVar("T")


class ForeseenCalls(Generic[Q, T]):
    """Works out answers before they are asked for, as many at the same time as cores are shared by.

    Which questions come next is often known but for what the first of them gives. What is begun and then not wanted
    took a core that would have stood still. Where only one may be worked out at a time, nothing is begun.

    Example:
        >>> from descentflow.core.side_by_side import cores_shared
        >>> with cores_shared(), ForeseenCalls(lambda number: 2 * number, lambda key: None) as calls:
        ...     calls.foresee({"six": 3, "eight": 4})
        ...     calls.ask("six", lambda: 6), calls.ask("ten", lambda: 10)
        (6, 10)
    """

    def __init__(self, answer: Callable[[Q], T], begins: Callable[[Any], None]) -> None:
        """Begin with none.

        Args:
            answer: Of a question, see :class:`~descentflow.core.worker.Worker`.
            begins: Called here with the key of each question when it begins to be worked out.
        """
        self._answer, self._begins = answer, begins
        self._waiting: dict[Hashable, Q] = {}
        self._running: dict[Hashable, Worker[Q, T]] = {}
        self._idle: list[Worker[Q, T]] = []
        self._done: dict[Hashable, T] = {}

    def __enter__(self) -> "ForeseenCalls[Q, T]":
        """Itself; nothing that it began is left behind at the end of the block, whatever happens in it."""
        return self

    def __exit__(self, *_: object) -> None:
        self.foresee({})
        while self._idle:
            self._idle.pop().end()

    def foresee(self, questions: Mapping[Hashable, Q]) -> None:
        """Work these out, the most probable first, and nothing else that was begun."""
        for key in [key for key in self._running if key not in questions]:
            self._running.pop(key).end()
        known = self._running.keys() | self._done.keys()
        self._waiting = {key: q for key, q in questions.items() if key not in known} if is_shared() else {}
        self._fill()

    def ask(self, key: Hashable, call: Callable[[], T]) -> T:
        """What a question gives, worked out by a call here and now unless it was begun.

        Raises:
            Exception: That of the call, or of the answer.
            MemoryError: If the copy that worked it out was killed, as it is where memory runs out.
        """
        if key in self._waiting and at_once() == 1 and not self._running:
            # As soon as what works beside it has ended, others are begun too: this process must be there to see it.
            self._run(key)
        while key in self._running:
            ready = wait([*(worker.pipe for worker in self._running.values()), *pipes_beside()])
            for other in [other for other, worker in self._running.items() if worker.pipe in ready and other != key]:
                self._collect(other)
            if self._running[key].pipe in ready:
                self._done[key] = self._received(key)
            self._fill()
        if key in self._done:
            return self._done.pop(key)
        self._waiting.pop(key, None)
        self._begins(key)
        return call()

    def _fill(self) -> None:
        while self._waiting and len(self._running) < at_once() and at_once() > 1:
            self._run(next(iter(self._waiting)))

    def _run(self, key: Hashable) -> None:
        self._begins(key)
        worker = self._idle.pop() if self._idle else Worker(self._answer)
        worker.ask(self._waiting.pop(key))
        self._running[key] = worker

    def _received(self, key: Hashable) -> T:
        """What a worker sent, which then is free for another question."""
        worker = self._running.pop(key)
        try:
            found = worker.result()
        except BaseException:
            worker.end()
            raise
        self._idle.append(worker)
        return found

    def _collect(self, key: Hashable) -> None:
        """Keep what was not asked for yet; what failed fails again once it is."""
        try:
            self._done[key] = self._received(key)
        except Exception:
            return
