"""A Gaussian over vectors with missing entries: covariance by EM, and precision matrices by pattern of what is seen."""

from dataclasses import dataclass
from functools import cached_property
from itertools import groupby

import torch
from torch import Tensor

from descentflow.core.recent import Recent

KEPT = 3
"""Selections of rows of the precisions that are kept: effects that show in the same quantities ask for the same."""
PARTS = 8
"""Parts of the flights whose precisions are kept: the folds, either side, and all real ones by fold."""
AT_ONCE = 1 << 21
"""Numbers that are worked out at a time: 16 MB."""
ITERATIONS = 6
"""Of EM; what is missing is mostly the top of the grid, and its neighbours say nearly all of it."""


@dataclass(frozen=True)
class Whitening:
    """Precision of what each flight shows.

    Shapes: ``pattern`` (n,) index of each flight's pattern, ``precision`` (patterns, p, p) zero where an entry is
    missing, ``covariance`` (p, p). Patterns that as many flights show are best numbered one after the other: their
    products are worked out together.

    Example:
        >>> from descentflow.diagnosis.inference.example_sides import example_sides
        >>> from descentflow.effects import EFFECTS
        >>> sides = example_sides(EFFECTS["temperature"], [10.0])
        >>> weights = whiten(sides.y, sides.real, sides.airframe, sides.nugget(), sides.of_flight())
        >>> weights.apply(sides.y).shape, weights.covariance.shape
        (torch.Size([160, 33]), torch.Size([33, 33]))
    """

    pattern: Tensor
    precision: Tensor
    covariance: Tensor
    optimism: Tensor
    """(n,) how much more widely flights scatter, in what the precision weighs most, than those it was learnt from."""
    between: Tensor
    """(p, p) covariance of single flights, without what is added so that means are weighed rightly; for new flights."""

    @cached_property
    def order(self) -> tuple[Tensor, Tensor]:
        """Flights with those of one pattern beside each other, and where each flight is among them."""
        order = torch.argsort(self.pattern, stable=True)
        return order, torch.argsort(order)

    @cached_property
    def groups(self) -> list[tuple[slice, slice]]:
        """Neighbouring patterns that as many flights show, and these flights in that order."""
        found: list[tuple[slice, slice]] = []
        first = start = 0
        counts = torch.bincount(self.pattern, minlength=len(self.precision)).tolist()
        for count, same in groupby(counts):
            last = first + len(list(same))
            stop = start + count * (last - first)
            if count:
                found.append((slice(first, last), slice(start, stop)))
            first, start = last, stop
        return found

    @cached_property
    def _kept_rows(self) -> Recent[Tensor]:
        return Recent(KEPT)

    def apply(self, values: Tensor) -> Tensor:
        """Precision times values: (n, p) or (n, p, k) of the flights, missing entries anything finite."""
        order, back = self.order
        if values.dim() == 2:
            return self._times(values[order], self.precision)[back]
        # Most effects show in a few quantities alone.
        used = torch.nonzero((values != 0).any(2).any(0))[:, 0]
        n, p, k = values.shape
        rows, found = self.of_entries(used), torch.empty(n, k, p, dtype=values.dtype)
        step = max(AT_ONCE // max(n * p, 1), 1)
        for at in range(0, k, step):
            part = values[:, used, at : at + step].transpose(1, 2)[order]
            count = part.shape[1]
            found[order, at : at + step] = self._times(part.flatten(1), rows, count).reshape(n, count, p)
        return found.transpose(1, 2)

    def _times(self, ordered: Tensor, precision: Tensor, k: int = 1) -> Tensor:
        """Values (n, k u) of ordered flights times the precision (patterns, u, p) of their own pattern: (n k, p)."""
        rows = ordered.reshape(k * len(ordered), precision.shape[1])
        found = torch.empty(len(rows), precision.shape[2], dtype=ordered.dtype)
        for patterns, at in self.groups:
            mine, own = slice(k * at.start, k * at.stop), precision[patterns]
            count, shown, entries = own.shape
            each = (mine.stop - mine.start) // count
            torch.bmm(rows[mine].view(count, each, shown), own, out=found[mine].view(count, each, entries))
        return found

    def of_entries(self, entries: Tensor) -> Tensor:
        """Rows (patterns, k, p) of the precisions."""
        return self._kept_rows.get(tuple(entries.tolist()), lambda: self.precision[:, entries])

    def rows(self, index: Tensor) -> "Whitening":
        """Of the flights at these positions; the same ones for the same positions, so that what they know is kept."""
        return self._parts.get(tuple(index.tolist()), lambda: self._rows(index))

    @cached_property
    def _parts(self) -> Recent["Whitening"]:
        return Recent(PARTS)

    def _rows(self, index: Tensor) -> "Whitening":
        shown, pattern = _numbered(self.pattern[index])
        return Whitening(pattern, self.precision[shown], self.covariance, self.optimism[index], self.between)

    def only(self, entries: Tensor, seen: Tensor) -> "Whitening":
        """Of some entries (k,) alone, whatever the others say; ``seen`` (n, p)."""
        patterns, pattern = _patterns(seen[:, entries])
        covariance, between = (c[entries][:, entries] for c in (self.covariance, self.between))
        return Whitening(pattern, _inverted(covariance, patterns), covariance, self.optimism, between)

    def total(self, chosen: Tensor) -> Tensor:
        """Sum of the precisions (p, p) of the chosen flights (n,) bool or weights."""
        weight = torch.zeros(len(self.precision), dtype=self.precision.dtype)
        weight.index_add_(0, self.pattern, chosen.to(weight.dtype))
        shown = torch.nonzero(weight)[:, 0]
        return torch.einsum("k,kij->ij", weight[shown], self.precision[shown])


def whiten(
    y: Tensor,
    groups: Tensor,
    airframe: Tensor,
    nugget: Tensor,
    apart: Tensor,
    learn: Tensor | None = None,
    held_out: Tensor | None = None,
    least: Tensor | None = None,
) -> Whitening:
    """Estimate a covariance within groups and invert it for every pattern.

    Two things are added to the spread between flights, so that weights are right for differences of means. Flights of
    one aircraft are alike, so in what they share (their schedule) they count as one: the covariance of the sum over an
    aircraft, a flight's share of it, is used. And no model is exact: a shift smaller than ``nugget`` means nothing,
    however many flights show it.

    Some entries are taken as independent of the others. That noise and gaps go with speed between flights does not say
    what they do where a cause moves the speed; a wrong guess would pull the estimate.

    Args:
        y: (n, p), NaN where missing.
        groups: (n,) bool: both groups have a mean of their own, which is taken off.
        airframe: (n,) aircraft.
        nugget: (p,) variance to add.
        apart: (p,) bool: entries that are taken as independent of the others.
        learn: (n,) bool: flights that it is estimated from; all if absent.
        held_out: (n,) folds of whole aircraft: each is weighed by what the flights of the other folds say, which also
            complete what is missing by what all say. The covariance that is returned beside is that of all.
        least: (p,) variance of a single flight at least. All flights of a simulator may show the very same value, but
            none of a real one is known so well; none if absent.

    Example:
        >>> noise = torch.randn(500, 2, generator=torch.Generator().manual_seed(0))
        >>> y = (noise @ torch.tensor([[1.0, 0.8], [0.0, 0.6]])).double()
        >>> alone, none, everyone = torch.arange(500), torch.zeros(2).double(), torch.ones(500, dtype=torch.bool)
        >>> whiten(y, everyone, alone, none, none.bool()).covariance.round(decimals=1)
        tensor([[1.0000, 0.8000],
                [0.8000, 1.0000]], dtype=torch.float64)
    """
    seen = y.isfinite()
    patterns, pattern = _patterns(seen)
    centred = y.clone()
    for side in (groups, ~groups):
        if bool(side.any()):
            centred[side] = y[side] - y[side].nanmean(0).nan_to_num(0.0)
    used = torch.ones(len(y), dtype=torch.bool) if learn is None else learn
    scale = centred[used].square().nanmean(0).sqrt().clamp(min=1e-12)
    z = torch.where(seen, centred / scale, 0.0)
    n, p = z[used].shape
    # Many flights speak for themselves; few are helped by a pull towards no correlation.
    pull = 2.0 + 0.25 * p * max(0.0, 1.0 - n / (4.0 * p))
    eye = torch.eye(p, dtype=z.dtype)
    covariance = _start(z[used], seen[used], pull)
    members = [torch.nonzero((pattern == k) & used)[:, 0] for k in range(len(patterns))]
    for _ in range(ITERATIONS):
        covariance = _symmetric((_moment(z, patterns, members, covariance) + pull * eye) / (n + pull))
    completed, within = _completed(z, patterns, members, covariance), covariance
    units, together = scale[:, None] * scale, apart[:, None] == apart

    def of_means(within: Tensor, flights: Tensor) -> Tensor:
        """Covariance that weighs differences of means, from flights (n,) bool that give the one of single flights."""
        whole = within + _shared(completed[flights], airframe[flights], within) + torch.diag(nugget / scale**2)
        return torch.where(together, whole, 0.0)

    covariance = of_means(within, used)
    # Along what is weighed most, flights that nothing was learnt from scatter more.
    between = torch.where(together, within, 0.0) * units * _optimism(within, within, n)
    if least is not None:
        between = between + torch.diag((least - between.diagonal()).clamp(min=0.0))
    if held_out is None:
        optimism = torch.where(used, _optimism(within, covariance, n), 1.0)
        return Whitening(pattern, _inverted(covariance * units, patterns), covariance * units, optimism, between)
    precision: list[Tensor] = []
    moved, base = torch.zeros_like(pattern), _moment(z, patterns, members, within)
    for fold in torch.unique(held_out).tolist():
        mine = held_out == fold
        own = [at[mine[at]] for at in members]
        other, count = used & ~mine, int((used & mine).sum())
        part = (base - _moment(z, patterns, own, within) + pull * eye) / (n - count + pull)
        shown, index = torch.unique(pattern[mine], return_inverse=True)
        moved[mine] = index + sum(len(p) for p in precision)
        precision.append(_inverted(of_means(_symmetric(part), other) * units, patterns[shown]))
    shown, moved = _numbered(moved)
    every = torch.cat(precision)[shown]
    return Whitening(moved, every, covariance * units, torch.ones(len(y), dtype=y.dtype), between)


def _patterns(seen: Tensor) -> tuple[Tensor, Tensor]:
    """Patterns (k, p) of what is seen (n, p), and the number (n,) of each flight's."""
    patterns, pattern = torch.unique(seen, dim=0, return_inverse=True)
    shown, pattern = _numbered(pattern)
    return patterns[shown], pattern


def _numbered(pattern: Tensor) -> tuple[Tensor, Tensor]:
    """Patterns (k,) that there are among those of flights (n,), by how many show them, and these by new numbers."""
    shown, number, counts = torch.unique(pattern, return_inverse=True, return_counts=True)
    order = torch.argsort(counts, stable=True)
    return shown[order], torch.argsort(order)[number]


def _symmetric(matrix: Tensor) -> Tensor:
    return (matrix + matrix.T) / 2


def _moment(z: Tensor, patterns: Tensor, members: list[Tensor], covariance: Tensor) -> Tensor:
    """Expected sum (p, p) of the products of what flights show, with what is missing as a covariance says it."""
    moment, completed = torch.zeros_like(covariance), z.clone()
    precision = torch.linalg.inv(covariance + 1e-9 * torch.eye(len(covariance), dtype=z.dtype))
    for there, at in zip(patterns, members, strict=True):
        gone, there_at = torch.nonzero(~there)[:, 0], torch.nonzero(there)[:, 0]
        if not len(at) or not len(gone):
            continue
        # Given what is there, what is gone has the inverse of its own block of the precision as covariance.
        rest = torch.linalg.inv(precision[gone[:, None], gone])
        weights = precision[there_at[:, None], gone] @ rest
        completed[at[:, None], gone] = -z[at[:, None], there_at] @ weights
        moment[gone[:, None], gone] += len(at) * rest
    shown = completed[torch.cat(members)]
    return moment + shown.T @ shown


def _optimism(learnt: Tensor, whole: Tensor, n: int) -> float:
    """Scatter of new flights over that of the n flights learnt from, along what is weighed most: 1 / (1 - p / n).

    As for the least-variance combination of p entries (Kan and Smith, 2008), with p the entries' worth of what was
    learnt: what is added to it is known without error.
    """
    entries = float(torch.trace(torch.linalg.solve(whole, learnt)))
    return 1.0 / max(1.0 - entries / n, 0.5)


def _inverted(covariance: Tensor, patterns: Tensor) -> Tensor:
    """Precision (patterns, p, p) of what each pattern sees, zero elsewhere."""
    scale = covariance.diagonal().sqrt()
    unit = covariance / (scale[:, None] * scale) + 1e-8 * torch.eye(len(scale), dtype=covariance.dtype)
    precision, whole = torch.zeros(len(patterns), *covariance.shape, dtype=covariance.dtype), torch.linalg.inv(unit)
    for k, there in enumerate(patterns):
        at, gone = torch.nonzero(there)[:, 0], torch.nonzero(~there)[:, 0]
        if 2 * len(gone) > len(there):
            inverse = torch.linalg.inv(unit[at[:, None], at])
        else:
            # What is gone taken out of the inverse of all: its own block is the smaller one.
            cross = whole[gone[:, None], at]
            inverse = whole[at[:, None], at] - cross.T @ torch.linalg.solve(whole[gone[:, None], gone], cross)
        precision[k][at[:, None], at] = inverse / (scale[at, None] * scale[at])
    return precision


def _completed(z: Tensor, patterns: Tensor, members: list[Tensor], covariance: Tensor) -> Tensor:
    """Values with what is missing replaced by its expectation."""
    filled = z.clone()
    for there, at in zip(patterns, members, strict=True):
        if bool(there.any()) and not bool(there.all()):
            weights = torch.linalg.solve(
                covariance[there][:, there] + 1e-9 * torch.eye(int(there.sum()), dtype=z.dtype),
                covariance[there][:, ~there],
            )
            block = filled[at]
            block[:, ~there] = block[:, there] @ weights
            filled[at] = block
    return filled


def _shared(z: Tensor, airframe: Tensor, covariance: Tensor) -> Tensor:
    """What flights of one aircraft share, (p, p) positive semidefinite, of few dimensions.

    The cross-products of different flights of an aircraft, where they stand out from what chance would give.
    """
    n, p = z.shape
    names, index = torch.unique(airframe, return_inverse=True)
    total = torch.zeros(len(names), p, dtype=z.dtype).index_add_(0, index, z)
    counts = torch.bincount(index).double()
    pairs = float((counts * (counts - 1)).sum())
    if pairs == 0:
        return torch.zeros_like(covariance)
    between = (total.T @ total - z.T @ z) / n
    values, vectors = torch.linalg.eigh(covariance)
    root = (vectors * values.clamp(min=1e-9).sqrt()) @ vectors.T
    inverse = (vectors * values.clamp(min=1e-9).rsqrt()) @ vectors.T
    size, direction = torch.linalg.eigh(inverse @ between @ inverse)
    # The largest eigenvalue of as many pairs of independent flights.
    chance = 2.0 * (p * pairs) ** 0.5 / n
    kept = torch.where(size > chance, size, 0.0)
    shared: Tensor = root @ (direction * kept) @ direction.T @ root
    return shared


def _start(z: Tensor, seen: Tensor, pull: float) -> Tensor:
    """Pairwise covariance, made positive definite."""
    there = seen.to(z.dtype)
    pairs = there.T @ there
    covariance = (z.T @ z + pull * torch.eye(z.shape[1], dtype=z.dtype)) / (pairs + pull)
    values, vectors = torch.linalg.eigh(covariance)
    start: Tensor = (vectors * values.clamp(min=1e-3)) @ vectors.T
    return start
