"""Batches of flights: what was observed of each, and its context."""

from typing import Any

import torch
from torch import Tensor
from torch.utils.data import DataLoader, Dataset

from descentflow.representation.evidence import Evidence


class _Flights(Dataset[Any]):
    """Flights in memory, taken a whole batch at a time."""

    def __init__(self, evidence: Evidence, context: Tensor | None) -> None:
        self.evidence, self.context = evidence, context

    def __len__(self) -> int:
        return len(self.evidence)

    def __getitem__(self, position: int) -> tuple[Evidence] | tuple[Evidence, Tensor]:
        return self.__getitems__([position])

    def __getitems__(self, positions: list[int]) -> tuple[Evidence] | tuple[Evidence, Tensor]:
        index = torch.tensor(positions)
        rows = self.evidence.rows(index)
        return (rows,) if self.context is None else (rows, self.context[index])


def flight_batches(
    evidence: Evidence, context: Tensor | None = None, batch_size: int = 512, *, shuffle: bool = False
) -> DataLoader[Any]:
    """A DataLoader of batches ``(evidence,)``, or ``(evidence, context)`` where there is a context.

    Args:
        evidence: Of n flights.
        context: (n, c) encoded context, if there is one.
        batch_size: Flights in a batch.
        shuffle: In another order in every epoch.

    Example:
        >>> (first,), (second,) = flight_batches(Evidence.of_weights(torch.randn(30, 4)), batch_size=20)
        >>> len(first), len(second)
        (20, 10)
    """
    # All is in memory and a batch is one slice: worker processes would only cost.
    return DataLoader(_Flights(evidence, context), batch_size=batch_size, shuffle=shuffle, collate_fn=_as_it_is)


def _as_it_is(batch: Any) -> Any:
    return batch
