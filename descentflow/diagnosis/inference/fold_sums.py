"""Sums by fold of what every fit needs, so that a fit costs small matrices and not flights.

The free mean and the common columns are in every fit: they are summed and factored once. A fit brings columns of the
real flights alone; columns that are alike in all of them (how signatures may be off) need no sum over flights at all.
"""

from collections.abc import Sequence
from copy import copy
from dataclasses import dataclass

import torch
from torch import Tensor

from descentflow.core.recent import Recent
from descentflow.diagnosis.inference.aircraft_groups import FOLDS
from descentflow.diagnosis.inference.linear_algebra import Block, Common, Design, solve
from descentflow.diagnosis.inference.whitening import Whitening

BLOCKS = 4
"""Blocks of columns that are kept: one fit starts where another ended."""
SUMS = 512
"""Sums of a block, and of two blocks, that are kept: a few hundred numbers each."""
RESTS = 4
"""Shifts for which it is kept what they leave of the flights: they are asked for several times in a row."""
NUDGE = 1e-9
"""Share of the diagonal added to what is factored once: columns that the mean contains."""


@dataclass(frozen=True)
class Sums:
    """By fold: products of columns with the common ones (F, b, k), and with one another (F, k, k).

    Example:
        >>> Sums(torch.zeros(5, 7, 2), torch.zeros(5, 2, 2)).inner.shape
        torch.Size([5, 2, 2])
    """

    cross: Tensor
    inner: Tensor


@dataclass(frozen=True)
class Rest:
    """What a shift leaves of the flights: precision times it (r, p) of the real ones, in the order of their folds.

    By fold its sum (F, p), its products with the common columns (F, b), and its square (F,), simulator included.
    """

    weighted: Tensor
    total: Tensor
    cross: Tensor
    square: Tensor


@dataclass(frozen=True)
class Profiled:
    """Sums (T, k, k) of training flights with the common columns at their best, and these (T, b, k) for each column.

    Example:
        >>> Profiled(torch.zeros(6, 3, 3), torch.zeros(6, 9, 3)).inner.shape
        torch.Size([6, 3, 3])
    """

    inner: Tensor
    common: Tensor


class FoldSums:
    """What every fit of some flights shares.

    Training sets are the flights without each fold, and then all flights: T = F + 1.

    Example:
        >>> from descentflow.diagnosis.inference.example_sides import example_likelihood
        >>> from descentflow.effects import EFFECTS
        >>> likelihood = example_likelihood(EFFECTS["temperature"], [10.0])
        >>> rest = likelihood.sums.rest(torch.zeros_like(likelihood.y))
        >>> left = float(likelihood.sums.profiled(rest, everyone=True).inner[0, 0, 0])  # with a mean for all flights
        >>> 0.5 < left / float((likelihood.y * likelihood.qy).sum()) < 1.0
        True
    """

    def __init__(
        self, whitening: Whitening, y: Tensor, real: Tensor, free: Tensor, common: Common, fold: Tensor
    ) -> None:
        """Sum and factor.

        Args:
            whitening: Precision of the flights.
            y: (n, p), zero where not seen.
            real: (n,) bool.
            free: (p,) bool: entries with a free mean.
            common: Columns of all flights.
            fold: (n,) of the cross-validation.
        """
        self.whitening, self.y, self.real, self.free, self.fold = whitening, y, real, free, fold
        self.common = common.columns
        self._blocks, self._crosses = Recent[tuple[Tensor, Block]](BLOCKS), Recent[tuple[Tensor, Tensor]](SUMS)
        self._pairs, self._rests = Recent[Tensor](SUMS), Recent[tuple[Tensor, Rest]](RESTS)
        parts = [self._base(fold == k, common) for k in range(FOLDS)]
        self.base = torch.stack(parts)
        self.n_base = self.base.shape[1]
        prior = torch.zeros(self.n_base, dtype=y.dtype)
        prior[int(free.sum()) :] = common.ridge
        whole = self._training(self.base) + torch.diag(prior)
        nudge = torch.diag_embed(NUDGE * whole.diagonal(dim1=1, dim2=2) + 1e-300)
        self.factor = torch.linalg.cholesky(whole + nudge) if self.n_base else whole
        # What belongs to real flights alone, in the order of their folds.
        shown = fold[real]
        self.order = torch.argsort(shown, stable=True)
        self.at = torch.nonzero(real)[:, 0][self.order]
        self.parts = [slice(int((shown < k).sum()), int((shown <= k).sum())) for k in range(FOLDS)]
        self.of_real = whitening.rows(self.at)
        self.weighted_real = self.of_real.apply(y[self.at])
        self.common_real = common.columns[self.at]
        self.precision = torch.stack([self.of_real.total(shown[self.order] == k) for k in range(FOLDS)])
        products = common.products[self.at]
        self.common_precision = torch.stack([products[part].sum(0).T for part in self.parts])
        simulated = torch.where(real[:, None], 0.0, whitening.apply(torch.where(real[:, None], 0.0, y)))
        self.of_simulated = torch.stack([self.gradient(simulated, fold == k) for k in range(FOLDS)])
        self.square_simulated = torch.stack([(simulated * y)[fold == k].sum() for k in range(FOLDS)])

    def of_other(self, y: Tensor) -> "FoldSums":
        """The same for other values (n, p) of the real flights; those of the simulator are as they were."""
        found = copy(self)
        found.y, found.weighted_real, found._rests = y, self.of_real.apply(y[self.at]), Recent(RESTS)
        return found

    def _base(self, at: Tensor, common: Common) -> Tensor:
        mean = self.whitening.total(at)[self.free][:, self.free]
        cross = common.products[at].sum(0)[self.free]
        inner = common.columns[at].flatten(0, 1).T @ common.products[at].flatten(0, 1)
        return torch.cat([torch.cat([mean, cross], 1), torch.cat([cross.T, inner], 1)], 0)

    def gradient(self, weighted: Tensor, at: Tensor | None = None) -> Tensor:
        """Products (b,) of the common columns with weighted values (n, p), over some flights (n,) or all of them."""
        chosen = weighted if at is None else torch.where(at[:, None], weighted, 0.0)
        return torch.cat([chosen.sum(0)[self.free], self.common.flatten(0, 1).T @ chosen.flatten()])

    def _training(self, by_fold: Tensor) -> Tensor:
        """Sums over the flights of each training set, from those by fold."""
        total = by_fold.sum(0, keepdim=True)
        return torch.cat([total - by_fold, total])

    def block(self, columns: Tensor, *, kept: bool = False) -> Block:
        """Columns (r, p, k) of the real flights in their own order; kept by their identity, if so wanted."""

        def made() -> tuple[Tensor, Block]:
            # The columns stay with their block, so that no other tensor can have their identity.
            return columns, self.block_of([columns])

        return self._blocks.get(id(columns), made)[1] if kept else made()[1]

    def block_of(self, parts: Sequence[Tensor]) -> Block:
        """Columns (r, p, k) of several beside each other, which are not copied twice."""
        ordered = torch.empty(*parts[0].shape[:2], sum(part.shape[2] for part in parts), dtype=parts[0].dtype)
        first = 0
        for part in parts:
            last = first + part.shape[2]
            ordered[:, :, first:last] = part[self.order]
            first = last
        return Block(ordered, self.of_real.apply(ordered))

    def of_columns(self, design: Design) -> Sums:
        """Sums of the columns of the real flights."""
        blocks, alike = design.blocks, design.alike
        known = [self._cross(block) for block in blocks]
        answer = self.precision @ alike
        none = answer[:, :, :0]
        total = torch.cat([none, *(one[0] for one in known)], 2)
        cross = torch.cat([self._of_common(none, none[:, :0]), *(one[1] for one in known)], 2)
        # Either of a pair may be the weighted one: the first, so that nothing depends on what was summed before.
        above = {(i, j): self._pair(blocks[i], blocks[j]) for j in range(len(blocks)) for i in range(j + 1)}
        places = range(len(blocks))
        rows = [torch.cat([above[i, j] if i <= j else above[j, i].transpose(1, 2) for j in places], 2) for i in places]
        own = torch.cat([torch.zeros(FOLDS, 0, total.shape[2], dtype=alike.dtype), *rows], 1)
        both = total.transpose(1, 2) @ alike
        inner = torch.cat([torch.cat([own, both], 2), torch.cat([both.transpose(1, 2), alike.T @ answer], 2)], 1)
        return Sums(torch.cat([cross, self._of_common(answer, self.common_precision @ alike)], 2), inner)

    def _of_common(self, total: Tensor, with_common: Tensor) -> Tensor:
        """Products (F, b, k) with the free mean and the common columns."""
        if not with_common.shape[2]:
            with_common = torch.zeros(FOLDS, self.n_base - int(self.free.sum()), 0, dtype=total.dtype)
        return torch.cat([total[:, self.free], with_common], 1)

    def _cross(self, block: Block) -> tuple[Tensor, Tensor]:
        """Sums (F, p, k) of precision times a block's columns, and products (F, b, k) with the common ones."""

        def made() -> tuple[Tensor, Tensor]:
            weighted = [block.products[part] for part in self.parts]
            total = torch.stack([one.sum(0) for one in weighted])
            pairs = zip(self.parts, weighted, strict=True)
            return total, self._of_common(
                total, torch.stack([self.common_real[part].flatten(0, 1).T @ one.flatten(0, 1) for part, one in pairs])
            )

        return self._crosses.get(block.key, made)

    def _pair(self, first: Block, second: Block) -> Tensor:
        """Products (F, k, l) of the columns of two blocks."""

        def made() -> Tensor:
            left, right = first.products, second.columns
            return torch.stack([left[part].flatten(0, 1).T @ right[part].flatten(0, 1) for part in self.parts])

        return self._pairs.get((first.key, second.key), made)

    def rest_of(self, shift: Tensor) -> "Rest":
        """What a shift (n, p) leaves of the real flights; kept for the last few shifts."""

        def made() -> tuple[Tensor, Rest]:
            moved = shift[self.at]
            left = self.y[self.at] - moved
            # Most effects shift a few quantities alone.
            weighted = self.weighted_real - self.of_real.apply(moved[:, :, None])[:, :, 0]
            total = torch.stack([weighted[part].sum(0) for part in self.parts])
            common = [self.common_real[part].flatten(0, 1).T @ weighted[part].flatten() for part in self.parts]
            square = torch.stack([(left[part] * weighted[part]).sum() for part in self.parts])
            cross = torch.cat([total[:, self.free], torch.stack(common)], 1) + self.of_simulated
            return shift, Rest(weighted, total, cross, square + self.square_simulated)

        return self._rests.get(id(shift), made)[1]

    def rest(self, shift: Tensor, design: Design | None = None, sums: Sums | None = None) -> Sums:
        """Sums of columns and, last, of what a shift (n, p) leaves of the flights, the simulator's own included."""
        left = self.rest_of(shift)
        mine, last = left.cross[:, :, None], left.square[:, None, None]
        if design is None or sums is None:
            return Sums(mine, last)
        own = [
            torch.stack([block.columns[part].flatten(0, 1).T @ left.weighted[part].flatten() for part in self.parts])
            for block in design.blocks
        ]
        edge = torch.cat([*own, left.total @ design.alike], 1)[:, :, None]
        inner = torch.cat([torch.cat([sums.inner, edge], 2), torch.cat([edge.transpose(1, 2), last], 2)], 1)
        return Sums(torch.cat([sums.cross, mine], 2), inner)

    def of_part(self, design: Design, keep: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        """Sums over some flights (n,): of the common columns (b, b), with them (b, k), and of the others (k, k)."""
        mine, common = keep[self.at], design.shared
        blank = self.common_real[mine][:, :, :0]
        columns, products = (
            torch.cat([blank, *(getattr(block, name)[mine] for block in design.blocks)], 2)
            for name in ("columns", "products")
        )
        total, answer = products.sum(0), self.of_real.total(mine) @ design.alike
        of_own = self.common_real[mine].flatten(0, 1).T @ products.flatten(0, 1)
        of_alike = common.products[self.at][mine].sum(0).T @ design.alike
        cross = torch.cat([torch.cat([total, answer], 1)[self.free], torch.cat([of_own, of_alike], 1)], 0)
        own, both = columns.flatten(0, 1).T @ products.flatten(0, 1), total.T @ design.alike
        inner = torch.cat([torch.cat([own, both], 1), torch.cat([both.T, design.alike.T @ answer], 1)], 0)
        return self._base(keep, common), cross, inner

    def profiled(self, sums: Sums, *, everyone: bool = False) -> Profiled:
        """Training sums with the common columns at their best (of all flights alone, if so wanted)."""
        if everyone:
            cross, inner, factor = sums.cross.sum(0)[None], sums.inner.sum(0)[None], self.factor[-1:]
        else:
            cross, inner, factor = self._training(sums.cross), self._training(sums.inner), self.factor
        if not self.n_base:
            return Profiled(inner, cross)
        half = torch.linalg.solve_triangular(factor, cross, upper=False)
        common = torch.linalg.solve_triangular(factor.transpose(1, 2), half, upper=True)
        return Profiled(inner - half.transpose(1, 2) @ half, common)

    def held_out(self, sums: Sums, profiled: Profiled) -> Tensor:
        """Products (F, k, k) of columns with one another in each fold, the common columns as the other folds say."""
        common = profiled.common[:FOLDS]
        with_common = sums.cross.transpose(1, 2) @ common
        return sums.inner - with_common - with_common.transpose(1, 2) + common.transpose(1, 2) @ (self.base @ common)

    def errors(self, shift: Tensor, design: Design, steps: Tensor, common: Tensor) -> Tensor:
        """What is left (n, p) of each flight under coefficients (F, k) and common ones (F, b) of the other folds."""
        left, f = self.y.clone(), int(self.free.sum())
        of_real = self.y[self.at] - shift[self.at]
        for number, part in enumerate(self.parts):
            sizes = [block.count for block in design.blocks]
            *own, alike = torch.split(steps[number], [*sizes, design.alike.shape[1]])
            for block, step in zip(design.blocks, own, strict=True):
                of_real[part] -= block.columns[part] @ step
            of_real[part] -= design.alike @ alike
        left[self.at] = of_real
        mean = torch.zeros(FOLDS, left.shape[1], dtype=left.dtype)
        mean[:, self.free] = common[:, :f]
        habits = torch.bmm(self.common, common[self.fold, f:, None])[:, :, 0]
        return left - habits - mean[self.fold]


def solved(profiled: Profiled, ridge: Tensor) -> Tensor:
    """Coefficients (T, k) of all columns but the last, which they explain.

    Example:
        >>> inner = torch.tensor([[[4.0, 2.0], [2.0, 9.0]]]).double()
        >>> solved(Profiled(inner, inner), torch.zeros(1).double()).round(decimals=3)
        tensor([[0.5000]], dtype=torch.float64)
    """
    inner = profiled.inner
    raw = inner.diagonal(dim1=1, dim2=2)[:, :-1]
    return solve(inner[:, :-1, :-1] + torch.diag(ridge), inner[:, :-1, -1], raw)
