"""Batches of flights: what was observed of each, and its context."""

from collections.abc import Iterator
from typing import Any

import torch
from torch import Tensor
from torch.utils.data import DataLoader, Dataset, DistributedSampler

from descentflow.core.counter_random import seed_for_index
from descentflow.representation.evidence import WeightEvidence


class _FlightDataset(Dataset[Any]):
    """Flights in memory, taken a whole batch at a time."""

    def __init__(self, evidence: WeightEvidence, context: Tensor) -> None:
        self.evidence, self.context = evidence, context

    def __len__(self) -> int:
        return len(self.evidence)

    def __getitem__(self, position: int) -> tuple[WeightEvidence, Tensor]:
        return self.__getitems__([position])

    def __getitems__(self, positions: list[int]) -> tuple[WeightEvidence, Tensor]:
        index = torch.tensor(positions)
        return self.evidence.rows(index), self.context[index]


class ShuffledByEpoch(DistributedSampler[int]):
    """All positions in an order that follows from a seed and the epoch alone, so that a resumed fit has it too.

    Of several processes each takes its part, all of one length: the first positions come again at the end for it.

    Example:
        >>> one, other = ShuffledByEpoch(100, seed=0), ShuffledByEpoch(100, seed=0)
        >>> other.set_epoch(1)
        >>> sorted(one) == sorted(other), list(one) == list(one), list(one) == list(other)
        (True, True, False)
    """

    def __init__(self, n: int, seed: int) -> None:
        """Begin with the first epoch.

        Args:
            n: Number of positions.
            seed: Of all epochs.
        """
        several = torch.distributed.is_available() and torch.distributed.is_initialized()
        world, rank = (torch.distributed.get_world_size(), torch.distributed.get_rank()) if several else (1, 0)
        super().__init__(range(n), num_replicas=world, rank=rank, seed=seed)  # type: ignore[arg-type]

    def __iter__(self) -> Iterator[int]:
        """The order of the epoch."""
        n = len(self.dataset)  # type: ignore[arg-type]
        order = torch.randperm(n, generator=torch.Generator().manual_seed(seed_for_index(self.seed, self.epoch)))
        return iter(order[torch.arange(self.rank, self.total_size, self.num_replicas) % n].tolist())


def flight_batches(
    evidence: WeightEvidence, context: Tensor, batch_size: int = 512, *, shuffle: bool = False
) -> DataLoader[Any]:
    """A DataLoader of batches ``(evidence, context)``.

    Args:
        evidence: Of n flights.
        context: (n, c) encoded context.
        batch_size: Flights in a batch.
        shuffle: In another order in every epoch, by torch's seed when this is called; each of several processes takes
            its part. Otherwise each goes through all flights.

    Example:
        >>> weights = WeightEvidence.of_weights(torch.randn(30, 4))
        >>> (first, _), (second, _) = flight_batches(weights, torch.empty(30, 0), batch_size=20)
        >>> len(first), len(second)
        (20, 10)
    """
    flights = _FlightDataset(evidence, context)
    # Of several processes each goes through all flights that are no longer trained on: none counts twice in a mean.
    whole: DistributedSampler[int] = DistributedSampler(flights, num_replicas=1, rank=0, shuffle=False)
    order = ShuffledByEpoch(len(evidence), torch.initial_seed()) if shuffle else whole
    # All is in memory and a batch is one slice: worker processes would only cost.
    return DataLoader(flights, batch_size=batch_size, sampler=order, collate_fn=_as_it_is)


def _as_it_is(batch: Any) -> Any:
    return batch
