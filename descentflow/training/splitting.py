"""Split of descents by flight or by aircraft, before anything is fitted, and batches of the training flights."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
import torch
from jsonargparse.typing import ClosedUnitInterval
from torch import Tensor
from torch.utils.data import DataLoader, Dataset, DistributedSampler

from descentflow.core.arguments import NotNegativeInt, checked_settings
from descentflow.core.counter_random import seed_for_index
from descentflow.core.errors import DataError
from descentflow.representation.evidence import WeightEvidence
from descentflow.representation.representation import Split


@checked_settings
@dataclass(frozen=True)
class SplitSettings:
    """Flights that are held out, before anything is fitted.

    Attributes:
        test_fraction: Share of the flights held out for test; with zero, none are.
        validation_fraction: Share of the other flights held out for validation; with zero, the training flights serve
            for it.
        split_by: What the split never tears apart: a flight, or an aircraft with all its flights.
        seed: Of the split.

    Example:
        >>> SplitSettings(split_by="aircraft").test_fraction
        0.2
    """

    test_fraction: ClosedUnitInterval = 0.2
    validation_fraction: ClosedUnitInterval = 0.1
    split_by: Literal["flight", "aircraft"] = "flight"
    seed: NotNegativeInt = 0


def split_flights(
    flight_ids: Sequence[str],
    groups: Sequence[str],
    settings: SplitSettings = SplitSettings(),
) -> Split:
    """Assign whole groups of flights to train, validation and test (paper, section 3: 80:20 before the fPCA).

    Args:
        flight_ids: One identifier per flight.
        groups: The group of each flight, whose flights stay in one part: the flight itself, or its aircraft.
        settings: Shares of the groups. The same identifiers, in any order, and the same seed give the same split.

    Raises:
        DataError: If a part would be empty, or training would have fewer than two flights.

    Example:
        >>> ids = [f"flight {number}" for number in range(10)]
        >>> split = split_flights(ids, ids)
        >>> len(split.train), len(split.validation), len(split.test)
        (7, 1, 2)
    """
    names = sorted(set(groups))
    order = np.random.default_rng(settings.seed).permutation(len(names))
    test_fraction, validation_fraction = settings.test_fraction, settings.validation_fraction
    n_test = max(round(test_fraction * len(names)), 1) if test_fraction > 0 else 0
    n_validation = max(round(validation_fraction * (len(names) - n_test)), 1) if validation_fraction > 0 else 0
    part_of = {names[i]: 0 if k < n_test else 1 if k < n_test + n_validation else 2 for k, i in enumerate(order)}
    parts: tuple[list[str], list[str], list[str]] = ([], [], [])
    for flight, group in zip(flight_ids, groups, strict=True):
        parts[part_of[group]].append(flight)
    test, validation, train = (tuple(sorted(part)) for part in parts)
    wanted = (test, test_fraction), (validation, validation_fraction)
    if len(train) < 2 or any(share > 0 and not part for part, share in wanted):
        raise DataError(
            f"{len(flight_ids)} flight(s) in {len(names)} group(s), too few to split",
            expected="at least two flights to train on and one each to validate and to test",
            mend="prepare more descents (a useful generator needs hundreds)",
        )
    return Split(train, validation, test)


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
