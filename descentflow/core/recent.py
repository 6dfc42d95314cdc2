"""Cache of the results of the last calls, by their arguments."""

from collections.abc import Callable, Hashable
from typing import Generic, TypeVar

V = TypeVar("V")


class Recent(Generic[V]):
    """The results of the last different calls; what was not asked for longest is forgotten first."""

    def __init__(self, most: int) -> None:
        """Begin with nothing."""
        self.most = most
        self.known: dict[Hashable, V] = {}

    def get(self, key: Hashable, make: Callable[[], V]) -> V:
        """The result of a key, made if it is not known."""
        made = self.known.pop(key) if key in self.known else make()
        if len(self.known) >= self.most:
            del self.known[next(iter(self.known))]
        self.known[key] = made
        return made
