"""The registered statistics level by level, for sets of descents that do not all span the grid (paper, section 4.1)."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import torch
from torch import Tensor

from descentflow.evaluation.metrics.distances import by_chunks, pool
from descentflow.evaluation.metrics.score_registry import level_statistics
from descentflow.evaluation.metrics.statistic_kinds import LevelStatistic


@dataclass(frozen=True)
class Distances:
    """Statistics by name, (L,) each in float64; NaN where either set has no value.

    ``n_first`` and ``n_second`` (L,) count the observed values of the two sets.

    Example:
        >>> found = Distances({"ks": torch.tensor([0.2, 0.4])}, torch.tensor([30, 20]), torch.tensor([30, 25]))
        >>> found["ks"][found.n_first >= 25]
        tensor([0.2000])
    """

    by_name: Mapping[str, Tensor]
    n_first: Tensor
    n_second: Tensor

    def __getitem__(self, name: str) -> Tensor:
        """A statistic (L,)."""
        return self.by_name[name]

    def unflatten(self, n: int) -> "Distances":
        """The same (n, K), where n sets of K levels were compared side by side."""
        by_name = {name: values.reshape(n, -1) for name, values in self.by_name.items()}
        return Distances(by_name, self.n_first.reshape(n, -1), self.n_second.reshape(n, -1))


def level_distances(
    first: Tensor,
    first_mask: Tensor,
    second: Tensor,
    second_mask: Tensor,
    statistics: Sequence[LevelStatistic] = (),
) -> Distances:
    """Statistics of two sets at each level.

    Args:
        first: (n, L) values, float32 or float64; masked values are not read.
        first_mask: (n, L) bool.
        second: (m, L) values.
        second_mask: (m, L) bool.
        statistics: Which; all that are registered if empty.

    Raises:
        DataError: If an observed value is not finite.

    Example:
        >>> one = torch.ones(1, 1)
        >>> level_distances(0 * one, one.bool(), 3 * one, one.bool())["wasserstein"]
        tensor([3.], dtype=torch.float64)
    """
    chosen = statistics or level_statistics()

    def compare(*chunk: Tensor) -> tuple[Tensor, ...]:
        pooled = pool(*chunk)
        return *(one.compute(pooled) for one in chosen), pooled.n_first[:, 0], pooled.n_second[:, 0]

    *found, n_first, n_second = by_chunks(compare, first, first_mask, second, second_mask)
    return Distances({one.name: values for one, values in zip(chosen, found, strict=True)}, n_first, n_second)


def joined(parts: Sequence[Distances]) -> Distances:
    """The splits of several batches, (n, K) each, in one.

    Example:
        >>> one = torch.ones(1, 10)
        >>> parts = [level_distances(k * one, one > 0, 0 * one, one > 0).unflatten(2) for k in (1, 2)]
        >>> joined(parts)["mae"].shape
        torch.Size([4, 5])
    """
    by_name = {name: torch.cat([one[name] for one in parts]) for name in parts[0].by_name}
    counts = (torch.cat([getattr(one, name) for one in parts]) for name in ("n_first", "n_second"))
    return Distances(by_name, *counts)
