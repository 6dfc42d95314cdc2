"""Draws by number, until they are plausible: the same seed and number give the same draw, alone or in a batch."""

from collections.abc import Callable
from typing import NamedTuple, Protocol

import numpy as np
import torch
from torch import Tensor

from descentflow.core.counter_random import DrawNumbers
from descentflow.core.errors import SamplingError
from descentflow.generation.conditional._latent_density import Array
from descentflow.generation.conditional.constraints import Constraint
from descentflow.generation.samples import RejectionReport
from descentflow.representation.decoder.trajectories import Trajectories, concatenate
from descentflow.representation.plausibility import RULES
from descentflow.representation.representation import Representation

FIRST_STREAM = 1 << 32
"""Streams of random numbers below it are those of corrections."""
ENTRY_STREAM = FIRST_STREAM + (1 << 20)
"""Of the numbers that choose levels of entry."""
LEAST_UNIFORM = 2.0**-54
"""In place of a uniform number that is zero, half of the next: its normal is finite."""
PROPOSALS_GROWTH = 4
"""Factor by which proposals grow where too few were effective."""
ROUNDS, ROUNDS_OF_EQUALS = 4, 5
"""Sizes that are tried, with weights and without: where one draw in 20 is plausible, one in 40 million fails."""
KEPT_ROUNDS = 4
"""Rounds (85 draws) in which draws of equal weight keep their level of entry, as samples do."""
LEAST_EFFECTIVE = 8.0
"""Effective proposals that a weighted draw is chosen among, at least."""
ROWS_AT_ONCE = 4096
"""Proposals flown at a time."""


class Proposed(NamedTuple):
    """n proposals: latent numbers (n, D), levels of entry (n,), log weights (n,), minus infinity where one cannot be.

    Example:
        >>> Proposed._fields
        ('u', 'entry', 'log_weight')
    """

    u: Tensor
    entry: Tensor
    log_weight: Array


class LatentTarget(Protocol):
    """Latent draws: uniform numbers (n, ``width``) in (0, 1) make n proposals; the first chooses the entry.

    ``proposals`` are made for each draw at first: 1 where all have the same weight.
    """

    width: int
    proposals: int

    def propose(self, uniform: Array) -> Proposed:
        """One proposal for each row."""

    def fly(self, u: Tensor, entry: Tensor) -> Trajectories:
        """Descents of latent numbers (n, D)."""


Judge = Callable[[Trajectories, np.ndarray], np.ndarray]
"""Rules (n, r) that descents break; the second argument is each one's number."""


def judge_of(representation: Representation, seed: int, *, flown: bool) -> Judge:
    """The bounds of a model; after a part was flown only whether descents go on to descend, as prediction asks.

    Args:
        representation: The model's.
        seed: Of corrections.
        flown: Whether a part was flown.
    """

    def broken(descents: Trajectories, numbers: np.ndarray) -> np.ndarray:
        whole = corrected(representation, seed, descents, numbers)
        rules: np.ndarray = representation.plausibility.broken_rules(whole).numpy()
        return rules

    def rises(descents: Trajectories, numbers: np.ndarray) -> np.ndarray:
        rules = np.zeros((len(numbers), len(RULES)), dtype=bool)
        rules[:, RULES.index("descends_too_slowly")] = (~descents.descends).numpy()
        return rules

    return rises if flown else broken


def corrected(representation: Representation, seed: int, flown: Trajectories, numbers: np.ndarray) -> Trajectories:
    """Descents with the effects of a correction, of which each has its part by its number (n,)."""
    correction, aircraft = representation.correction, representation.decoder.aircraft
    if correction is None:
        return flown
    each = (flown.subset(torch.tensor([i])) for i in range(len(flown)))
    drawn = (DrawNumbers(seed, int(number)) for number in numbers)
    return concatenate([correction.apply(aircraft, *both) for both in zip(each, drawn, strict=True)])


class Accepted(NamedTuple):
    """n draws: latent numbers (n, D), descents, effective ones (n,) of as many proposals or more, and the account.

    Example:
        >>> Accepted._fields
        ('u', 'flown', 'effective', 'proposals', 'report')
    """

    u: Tensor
    flown: Trajectories
    effective: Array
    proposals: int
    report: RejectionReport


class NothingPlausible(Exception):
    """A request that the model knows no flight for; ``culprit``, a speed or a point, cannot be met where it is known.

    Example:
        >>> NothingPlausible().culprit is None
        True
    """

    def __init__(self, culprit: Constraint | None = None) -> None:
        """Say what cannot be met."""
        super().__init__(culprit)
        self.culprit = culprit


def uniform_of(seed: int, numbers: np.ndarray, count: int, stream: int) -> Array:
    """Numbers (n, count) in (0, 1) of draws by their ascending numbers (n,); other streams are other numbers.

    Example:
        >>> ten = uniform_of(3, np.arange(10), 5, stream=0)
        >>> np.array_equal(uniform_of(3, np.array([2, 6, 7]), 5, stream=0), ten[[2, 6, 7]])
        True
    """
    runs = np.split(numbers, np.flatnonzero(np.diff(numbers) != 1) + 1)
    parts = [DrawNumbers(seed, int(run[0]) * count).uniform(len(run) * count, stream) for run in runs]
    uniform: Array = np.maximum(torch.cat(parts).numpy().reshape(len(numbers), count), LEAST_UNIFORM)
    return uniform


def accepted(target: LatentTarget, seed: int, numbers: np.ndarray, judge: Judge) -> Accepted:
    """For each number one of its own plausible proposals, by weight.

    Proposals are drawn one after another without replacement, until one is plausible: few of them are flown.

    Args:
        target: The density that is drawn from.
        seed: Of the draws.
        numbers: (n,) ascending numbers of the draws.
        judge: Which rules proposals break.

    Raises:
        NothingPlausible: If no proposal of a number is plausible.
        SamplingError: If too few are effective.

    Example:
        >>> from descentflow.densities.checkpoint import load_model
        >>> from descentflow.generation.conditional._conditioned_density import conditioned_target
        >>> from descentflow.generation.conditional.constraints import DescentRequest
        >>> from descentflow.generation.conditional._latent_density import LatentDensities
        >>> model = load_model("best.ckpt")
        >>> target = conditioned_target(DescentRequest(entry=180), LatentDensities(model).before(), model)
        >>> draws = accepted(target, 0, np.arange(50), judge_of(model.representation, 0, flown=False))
        >>> draws.report.accepted, bool(model.representation.plausibility.broken_rules(draws.flown).any())
        (50, False)
    """
    search, pending = _Search(target, seed, numbers, judge), np.arange(len(numbers))
    for attempt in range(ROUNDS_OF_EQUALS if search.equal else ROUNDS):
        size = target.proposals * PROPOSALS_GROWTH**attempt
        for group in np.array_split(pending, -(-len(pending) * size // ROWS_AT_ONCE)):
            search.propose(group, size, attempt)
        pending = np.setdiff1d(pending, search.owners)
        if not len(pending):
            return search.result()
    effective = search.effective[pending]
    if (search.none[pending] | (effective < 1)).any():
        raise NothingPlausible
    raise SamplingError(
        f"{effective.min():.0f} effective of {size} proposals",
        expected=f"at least {LEAST_EFFECTIVE:.0f}: what is asked together is rare among the model's descents",
        mend="ask for a band, or for less at once",
    )


class _Search:
    """Draws of some numbers: which were found, and the account of those flown."""

    def __init__(self, target: LatentTarget, seed: int, numbers: np.ndarray, judge: Judge) -> None:
        self.target, self.seed, self.numbers, self.judge = target, seed, numbers, judge
        self.equal = target.proposals == 1
        self.effective, self.none = np.ones(len(numbers)), np.zeros(len(numbers), dtype=bool)
        self.flown, self.rejected, self.broken = 0, 0, np.zeros(len(RULES), dtype=int)
        self.owners = np.zeros(0, dtype=int)
        self.found: list[tuple[Tensor, Trajectories]] = []

    def propose(self, group: np.ndarray, size: int, attempt: int) -> None:
        """Make ``size`` proposals for each of the numbers at these positions, and fly them until one is plausible."""
        which, width = self.numbers[group], self.target.width + 1
        uniform = uniform_of(self.seed, which, size * width, FIRST_STREAM + attempt).reshape(-1, width)
        if self.equal and attempt < KEPT_ROUNDS:
            uniform[:, 0] = uniform_of(self.seed, which, 1, ENTRY_STREAM)[:, 0].repeat(size)
        proposed = self.target.propose(uniform[:, :-1])
        log_weight = proposed.log_weight.reshape(-1, size)
        if not self.equal:
            self.effective[group] = effective_number(log_weight)
        # With Gumbel numbers added, the order of weights is that of draws without replacement.
        order = np.argsort(np.log(-np.log(uniform[:, -1])).reshape(-1, size) - log_weight, axis=1)
        waiting = np.flatnonzero(self.equal | (self.effective[group] >= LEAST_EFFECTIVE))
        tried = 0
        while len(waiting) and tried < size:
            some = order[waiting, tried : max(2 * tried, 1)]
            met = self._fly(proposed, group[waiting], waiting[:, None] * size + some, tried)
            waiting, tried = waiting[~met], tried + some.shape[1]
        self.none[group[waiting]] = True

    def _fly(self, proposed: Proposed, owners: np.ndarray, rows: np.ndarray, tried: int) -> np.ndarray:
        """Fly rows (w, m) of proposals for w owners, and keep the first plausible; whether there was one (w,)."""
        at = torch.from_numpy(rows.ravel())
        u = proposed.u[at]
        descents = self.target.fly(u, proposed.entry[at])
        rules = self.judge(descents, self.numbers[owners].repeat(rows.shape[1]))
        bad = np.asarray(rules.any(1))
        good = np.asarray(~bad & np.isfinite(proposed.log_weight[rows.ravel()])).reshape(rows.shape)
        place, met = good.argmax(1), np.asarray(good.any(1))
        # Of the j flown until one is plausible, about 2 in j + 1 are: so many fewer are effective.
        enough = met & (self.equal | (self.effective[owners] >= LEAST_EFFECTIVE * (tried + place + 2) / 2))
        first = np.flatnonzero(enough) * rows.shape[1] + place[enough]
        self.owners = np.concatenate([self.owners, owners[enough]])
        self.found.append((u[first], descents.subset(torch.from_numpy(first))))
        self.flown, self.rejected = self.flown + len(bad), self.rejected + int(bad.sum())
        self.broken += rules.sum(0)
        return met

    def result(self) -> Accepted:
        """All of them in the order of their numbers."""
        n, order = len(self.numbers), torch.from_numpy(self.owners.argsort(kind="stable"))
        of_groups, flown_of_groups = zip(*self.found, strict=True)
        u, flown = torch.cat(of_groups), concatenate(flown_of_groups)
        counts = dict(zip(RULES, self.broken.tolist(), strict=True))
        report = RejectionReport(self.flown, n, self.rejected, self.flown - n - self.rejected, counts)
        return Accepted(u[order], flown.subset(order), self.effective, self.target.proposals, report)


def effective_number(log_weight: Array) -> Array:
    """Effective number (n,) of proposals by their log weights (n, M), minus infinity where one cannot be.

    Example:
        >>> effective_number(np.log([[1.0, 1.0, 2.0]]))
        array([2.66666667])
    """
    with np.errstate(invalid="ignore", divide="ignore"):
        shares = np.exp(log_weight - log_weight.max(1, keepdims=True))
        effective: Array = shares.sum(1) ** 2 / (shares**2).sum(1)
    return np.nan_to_num(effective)
