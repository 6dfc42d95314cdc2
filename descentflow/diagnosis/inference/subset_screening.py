r"""All sets of up to four effects at once, by what each would gain on held-out flights were shifts linear.

About its own fit an effect shifts :math:`d(\theta) \approx d(\hat\theta) + J (\theta - \hat\theta)`. So all that a set
gains is in one table of products between sensitivities, offsets :math:`d(\hat\theta) - J \hat\theta`, columns by which
signatures may be off, and what was measured, summed by fold: a thousand sets cost as many small solves and no flight.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import torch
from torch import Tensor
from torch.nn.utils.rnn import pad_sequence

from descentflow.diagnosis.inference.aircraft_groups import FOLDS
from descentflow.diagnosis.inference.discrepancy import DiscrepancyColumns
from descentflow.diagnosis.inference.likelihood import EffectsLikelihood
from descentflow.diagnosis.inference.linear_algebra import RIDGE, Design
from descentflow.diagnosis.inference.signature_columns import signature_columns

MAX_EFFECTS = 4
"""Effects in a set at most: some 1,500 sets of 14 effects. More causes at once have not been met."""
UNKNOWN_TO_DATA = 1e9
"""Prior precision, in units of the information, of a column that the data say nothing about."""


@dataclass(frozen=True, eq=False)
class Member:
    """An effect about some parameters: sensitivities (r, p, k) and offset (r, p) of real flights, and columns (p, c).

    Example:
        >>> Member("mass", torch.zeros(5, 3, 1), torch.zeros(5, 3), torch.zeros(3, 2)).name
        'mass'
    """

    name: str
    sensitivity: Tensor
    offset: Tensor
    alike: Tensor
    scale: str = ""
    """Of effects that scale one equation together, the first; empty for others."""


def member_of(likelihood: EffectsLikelihood, name: str, theta: Tensor) -> Member:
    """An effect about parameters (k,).

    Example:
        >>> from descentflow.diagnosis.inference.example_sides import example_likelihood
        >>> from descentflow.effects import EFFECTS
        >>> likelihood = example_likelihood(EFFECTS["temperature"], [10.0])
        >>> warm = member_of(likelihood, "temperature", torch.tensor([10.0]).double())
        >>> tas = likelihood.compared.of("tas")
        >>> shift = 10.0 * warm.sensitivity[:, tas, 0] + warm.offset[:, tas]
        >>> round(float(shift.mean()), 3), float(warm.offset[:, tas].abs().max()) < 0.001  # nearly linear
        (0.021, True)
    """
    jacobian = likelihood.real_jacobian(name, theta)
    shift = likelihood.real_shift(name, theta)
    group = likelihood.catalogue[name].scale_group
    scale = "" if group is None else group.members[0]
    return Member(name, jacobian, shift - jacobian @ theta, signature_columns(likelihood, {name: theta}), scale)


def joined_members(likelihood: EffectsLikelihood, members: Sequence[Member]) -> Design:
    """Sensitivities and offsets of effects side by side: what takes longest of a screening, with a discrepancy or not.

    Example:
        >>> from descentflow.diagnosis.inference.example_sides import example_likelihood
        >>> from descentflow.effects import EFFECTS
        >>> likelihood = example_likelihood(EFFECTS["temperature"], [10.0])
        >>> members = [member_of(likelihood, n, torch.zeros(1).double()) for n in ("temperature", "mass")]
        >>> joined_members(likelihood, members).n_own
        4
    """
    columns = [[m.sensitivity for m in members], [m.offset[:, :, None] for m in members]]
    blocks = tuple(likelihood.sums.block_of(parts) for parts in columns)
    return likelihood.of_blocks(blocks, torch.cat([m.alike for m in members], 1))


def plain_and_free(
    likelihood: EffectsLikelihood, members: Sequence[Member], discrepancy: DiscrepancyColumns, precision: Tensor
) -> tuple["Screening", "Screening"]:
    """The same sets by themselves, and each with a discrepancy of prior precision (e,) beside it.

    Example:
        >>> from descentflow.diagnosis.inference.discrepancy import discrepancy_columns
        >>> from descentflow.diagnosis.inference.example_sides import example_likelihood
        >>> from descentflow.effects import EFFECTS
        >>> likelihood = example_likelihood(EFFECTS["temperature"], [10.0])
        >>> columns = discrepancy_columns(likelihood.compared)
        >>> members = [member_of(likelihood, "temperature", torch.zeros(1).double())]
        >>> plain, free = plain_and_free(likelihood, members, columns, torch.ones(len(columns)).double())
        >>> plain.scores([()])[()] < free.scores([()])[()] < plain.scores([(0,)])[("temperature",)]
        True
    """
    design = joined_members(likelihood, members)
    plain = Screening(likelihood, members, design=design)
    return plain, Screening(likelihood, members, discrepancy, precision, design)


class Screening:
    """The table of products, and what every set gains by it.

    Example:
        >>> from descentflow.diagnosis.inference.example_sides import example_likelihood
        >>> from descentflow.effects import EFFECTS
        >>> likelihood = example_likelihood(EFFECTS["temperature"], [10.0])
        >>> members = [member_of(likelihood, n, torch.zeros(1).double()) for n in ("temperature", "mass", "drag_polar")]
        >>> scores = Screening(likelihood, members).scores(sets_of(members))
        >>> best = max(scores, key=scores.get)
        >>> "temperature" in best, len(scores)
        (True, 6)
    """

    def __init__(
        self,
        likelihood: EffectsLikelihood,
        members: Sequence[Member],
        discrepancy: DiscrepancyColumns | None = None,
        precision: Tensor | None = None,
        design: Design | None = None,
    ) -> None:
        """Sum the products.

        Args:
            likelihood: Of the flights.
            members: Effects, each once or about several parameters.
            discrepancy: Columns of a shift without a cause, which every set then has beside it.
            precision: (e,) prior precision of their coefficients.
            design: What :func:`joined_members` gives of them, where it is known.
        """
        self.members = list(members)
        design = joined_members(likelihood, members) if design is None else design
        own = design.n_own
        if discrepancy is not None:
            design = likelihood.beside(design, discrepancy)
        sums = likelihood.sums.rest(torch.zeros_like(likelihood.y), design, likelihood.sums.of_columns(design))
        profiled = likelihood.sums.profiled(sums)
        tables = profiled.inner, likelihood.sums.held_out(sums, profiled)
        if discrepancy is not None and precision is not None:
            gone = torch.arange(own, own + len(discrepancy))
            tables = _profiled_out(*tables, gone, precision)
        self.inner, self.held_out = tables
        self.last = self.inner.shape[1] - 1
        self._place()

    def _place(self) -> None:
        """Which columns belong to which member."""
        sizes = [m.sensitivity.shape[2] for m in self.members]
        widths = [m.alike.shape[1] for m in self.members]
        own = torch.split(torch.arange(sum(sizes)), sizes)
        self.offset = torch.arange(sum(sizes), sum(sizes) + len(sizes))
        first = sum(sizes) + len(sizes)
        alike = torch.split(torch.arange(first, first + sum(widths)), widths)
        at = [torch.cat(pair) for pair in zip(own, alike, strict=True)]
        self.at = pad_sequence(at, batch_first=True, padding_value=self.last + 1) if at else torch.zeros(0, 0).long()
        self.ridge = torch.zeros(self.last + 2, dtype=torch.float64)
        self.ridge[first : self.last] = 1.0
        self.ridge[-1] = 1.0
        self.problems = [_Problems(_padded(inner), self.ridge) for inner in self.inner]

    def scores(self, sets: Sequence[tuple[int, ...]]) -> dict[tuple[str, ...], float]:
        """Held-out log score of every set, by the sorted names of its effects, the best of several; with its prior."""
        found: dict[tuple[str, ...], float] = {}
        by_size: dict[int, list[tuple[int, ...]]] = {}
        for members in sets:
            by_size.setdefault(len(members), []).append(members)
        for group in by_size.values():
            for members, score in zip(group, self._of_size(group).tolist(), strict=True):
                names = tuple(sorted(self.members[i].name for i in members))
                found[names] = max(score, found.get(names, -torch.inf))
        return found

    def _of_size(self, group: list[tuple[int, ...]]) -> Tensor:
        """Scores of sets that have as many members each."""
        members = torch.tensor(group, dtype=torch.long).reshape(len(group), -1)
        # Sets with fewer columns are filled up with the one that is zero, which is the last.
        index = self.at[members].flatten(1).sort(1).values
        index = index[:, : int((index <= self.last).sum(1).max())]
        # What was measured, without the offsets.
        known = torch.zeros(len(group), self.last + 2, dtype=torch.float64)
        known[:, self.last] = 1.0
        known.scatter_(1, self.offset[members], -1.0)
        ridge = self.ridge[index]
        total = torch.zeros(len(group), dtype=torch.float64)
        for fold, problem in enumerate(self.problems):
            step = problem.solved(index, known)
            if fold == FOLDS:
                # Of all flights: what is off in them is as improbable as its prior says.
                total -= 0.5 * (ridge * step**2).sum(1)
                break
            left = known.scatter_add(1, index, -step)
            total -= 0.5 * (left @ _padded(self.held_out[fold]) * left).sum(1)
        return total


class _Problems:
    """Penalised least squares of any columns of one table, in units in which every column is as large."""

    def __init__(self, inner: Tensor, ridge: Tensor) -> None:
        """Scale the table (l, l); ``ridge`` (l,) is the prior precision of its columns."""
        raw = inner.diagonal()
        known = raw + ridge > 1e-9
        self.inner, self.size = inner, torch.where(known, raw + ridge, 1.0).sqrt()
        self.scaled = inner / (self.size[:, None] * self.size)
        # What the data say nothing about is left alone.
        self.more = ridge / self.size**2 + torch.where(known, RIDGE, UNKNOWN_TO_DATA)

    def solved(self, index: Tensor, known: Tensor) -> Tensor:
        """Coefficients (s, k) of columns (s, k) that explain most of a sum of columns with weights (s, l)."""
        matrix = self.scaled[index[:, :, None], index[:, None, :]]
        matrix.diagonal(dim1=1, dim2=2).add_(self.more[index])
        size = self.size[index]
        target = (known @ self.inner).gather(1, index)
        found: Tensor = torch.linalg.solve(matrix, (target / size)[..., None])[..., 0] / size
        return found


def _padded(table: Tensor) -> Tensor:
    """A table (l, l) with one more column and row, of zeros."""
    return torch.nn.functional.pad(table, (0, 1, 0, 1))


def _profiled_out(inner: Tensor, held_out: Tensor, gone: Tensor, ridge: Tensor) -> tuple[Tensor, Tensor]:
    """Both tables without some penalised columns, which explain what they can of all others."""
    kept = torch.ones(inner.shape[1], dtype=torch.bool)
    kept[gone] = False
    kept_at = torch.nonzero(kept)[:, 0]
    penalty = torch.diag(ridge)
    cross = inner[:, gone[:, None], kept_at]
    share = torch.linalg.solve(inner[:, gone[:, None], gone] + penalty, cross)
    left = inner[:, kept_at[:, None], kept_at] - cross.transpose(1, 2) @ share
    share = share[:FOLDS]
    between = held_out[:, kept_at[:, None], gone] @ share
    own = share.transpose(1, 2) @ held_out[:, gone[:, None], gone] @ share
    return left, held_out[:, kept_at[:, None], kept_at] - between - between.transpose(1, 2) + own


def sets_of(members: Sequence[Member], most: int = MAX_EFFECTS) -> list[tuple[int, ...]]:
    """Places of the members of every set of at most so many different effects, none included.

    Of effects that scale one equation together only ratios can be observed: two of them are one of another size.

    Example:
        >>> blank = torch.zeros(0)
        >>> sets_of([Member(n, blank, blank, blank) for n in ("mass", "lag", "lag")], most=2)
        [(), (0,), (1,), (2,), (0, 1), (0, 2)]
    """
    found = [chosen for size in range(most + 1) for chosen in combinations(range(len(members)), size)]
    scale = [members[i].scale or members[i].name for i in range(len(members))]
    return [chosen for chosen in found if len({scale[i] for i in chosen}) == len(chosen)]
