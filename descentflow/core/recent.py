"""Cache of the results of the last calls, by their arguments."""

from collections.abc import Callable, Hashable
from typing import Generic, TypeVar

V = TypeVar("V")


class Recent(Generic[V]):
    """The results of the last different calls; what was not asked for longest is forgotten first.

    Example:
        >>> squares = Recent[int](most=2)
        >>> squares.get(3, lambda: 3**2), squares.get(4, lambda: 4**2)
        (9, 16)
        >>> squares.get(3, lambda: 1 / 0), squares.get(5, lambda: 5**2)  # the first is not worked out again
        (9, 25)
        >>> sorted(squares.known)
        [3, 5]
    """

    def __init__(self, most: int) -> None:
        """Begin with nothing.

        Args:
            most: Results that are kept.
        """
        self.most = most
        self.known: dict[Hashable, V] = {}

    def get(self, key: Hashable, make: Callable[[], V]) -> V:
        """The result of a key, made if it is not known.

        Args:
            key: What it is computed from.
            make: Computes it.
        """
        made = self.known.pop(key) if key in self.known else make()
        if len(self.known) >= self.most:
            del self.known[next(iter(self.known))]
        self.known[key] = made
        return made
