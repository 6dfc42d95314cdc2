"""A copy of this process that answers one question after another."""

import pickle
from collections.abc import Callable
from functools import partial
from typing import Any, Generic, TypeVar

from descentflow.core.forked import answered, forked, killed, received

Q = TypeVar("Q")
T = TypeVar("T")


class Worker(Generic[Q, T]):
    """Answers questions by what this process knew when it was made, and by what it found since.

    A copy for each question (:class:`~descentflow.core.side_by_side.Begun`) takes 25 ms at half a gigabyte, and begins
    without what others have worked out.

    Example:
        >>> worker = Worker(lambda number: 6 * number)
        >>> worker.ask(7)
        >>> worker.result()
        42
        >>> worker.end()
    """

    def __init__(self, answer: Callable[[Q], T]) -> None:
        """Begin.

        Args:
            answer: Gives what is sent back; it and the question must be such that pickle takes them.
        """
        self._process, self.pipe = forked(lambda pipe: _answer_all(answer, pipe))

    def ask(self, question: Q) -> None:
        """Send a question; :attr:`pipe` is readable once it is answered.

        Raises:
            MemoryError: If the copy was killed, as it is where memory runs out.
        """
        try:
            # Plain pickle: torch's own would share memory between the two.
            self.pipe.send_bytes(pickle.dumps(question))
        except ConnectionError:
            raise killed(self._process) from None

    def result(self) -> T:
        """The answer.

        Raises:
            Exception: That of the answer.
            MemoryError: If the copy was killed.
        """
        try:
            sent = self.pipe.recv_bytes()
        except (EOFError, ConnectionError):
            raise killed(self._process) from None
        found: T = received(sent)
        return found

    def end(self) -> None:
        """Leave nothing of it behind."""
        self._process.terminate()
        self._process.join()
        self.pipe.close()


def _answer_all(answer: Callable[[Any], object], pipe: Any) -> None:
    """In the copy: until nobody asks any more."""
    while True:
        try:
            question = pickle.loads(pipe.recv_bytes())
        except (EOFError, ConnectionError):
            return
        pipe.send_bytes(answered(partial(answer, question)))
