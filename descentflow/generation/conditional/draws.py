"""Draws by number, until they are plausible: the same seed and number give the same draw, alone or in a batch."""

from collections.abc import Callable
from typing import NamedTuple, Protocol

import numpy as np
import torch
from torch import Tensor

from descentflow.core.counter_random import DrawNumbers
from descentflow.core.errors import SamplingError
from descentflow.generation.conditional.latent_density import Array
from descentflow.generation.samples import RejectionReport
from descentflow.representation.decoder.trajectories import Trajectories, concatenate
from descentflow.representation.plausibility import RULES
from descentflow.representation.representation import Representation

FIRST_STREAM = 1 << 32
"""Streams of random numbers below it are those of corrections."""
CHOICE_STREAM, CELL_STREAM = FIRST_STREAM + (1 << 20), FIRST_STREAM + (1 << 21)
"""Of the numbers that choose among proposals, and of those that choose Gaussian and level of entry."""
LEAST_UNIFORM = 2.0**-54
"""In place of a uniform number that is zero, half of the next: its normal is finite."""
MORE = 4
"""Factor by which proposals grow where too few were effective."""
ROUNDS, ROUNDS_OF_EQUALS = 4, 5
"""Sizes that are tried, with weights and without: where one draw in 20 is plausible, one in 40 million fails."""
KEPT_ROUNDS = 3
"""Rounds (21 draws) in which draws of equal weight keep their Gaussian and level of entry, as samples do."""
LEAST_EFFECTIVE = 8.0
"""Effective proposals that a weighted draw is chosen among, at least."""
ROWS_AT_ONCE = 4096
"""Proposals flown at a time."""


class Drawn(NamedTuple):
    """n draws: latent numbers (n, D), what they fly, and log weights (n,), minus infinity where a draw cannot be.

    Example:
        >>> Drawn._fields
        ('u', 'flown', 'log_weight')
    """

    u: Tensor
    flown: Trajectories
    log_weight: Array

    def subset(self, index: np.ndarray) -> "Drawn":
        """The draws at these positions."""
        at = torch.from_numpy(index)
        return Drawn(self.u[at], self.flown.subset(at), self.log_weight[index])


class Target(Protocol):
    """Latent draws: uniform numbers (n, ``width``) in (0, 1) make n draws; the first chooses Gaussian and entry.

    ``proposals`` are made for each draw at first: 1 where all draws have the same weight.
    """

    width: int
    proposals: int

    def draw(self, uniform: Array) -> Drawn:
        """One draw for each row."""


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
        found: np.ndarray = representation.plausibility.broken_rules(whole).numpy()
        return found

    def rises(descents: Trajectories, numbers: np.ndarray) -> np.ndarray:
        rules = np.zeros((len(numbers), len(RULES)), dtype=bool)
        rules[:, RULES.index("descends_too_slowly")] = (~(descents.rate_mps < 0) & descents.mask).any(1).numpy()
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
    """n draws, the effective ones (n,) of as many proposals or more that each was chosen among, and the account.

    Example:
        >>> Accepted._fields
        ('drawn', 'effective', 'proposals', 'report')
    """

    drawn: Drawn
    effective: Array
    proposals: int
    report: RejectionReport


class NoneLeft(Exception):
    """No draw of a number is plausible."""


def uniform_of(seed: int, numbers: np.ndarray, count: int, stream: int) -> Array:
    """Numbers (n, count) in (0, 1) of draws by their ascending numbers (n,); other streams are other numbers.

    Example:
        >>> ten = uniform_of(3, np.arange(10), 5, stream=0)
        >>> np.array_equal(uniform_of(3, np.array([2, 6, 7]), 5, stream=0), ten[[2, 6, 7]])
        True
    """
    runs = np.split(numbers, np.flatnonzero(np.diff(numbers) != 1) + 1)
    parts = [DrawNumbers(seed, int(run[0]) * count).uniform(len(run) * count, stream) for run in runs]
    found: Array = np.maximum(torch.cat(parts).numpy().reshape(len(numbers), count), LEAST_UNIFORM)
    return found


def accepted(target: Target, seed: int, numbers: np.ndarray, judge: Judge) -> Accepted:
    """For each number one of its own plausible proposals, by weight.

    Args:
        target: What is drawn from.
        seed: Of the draws.
        numbers: (n,) ascending numbers of the draws.
        judge: Which rules proposals break.

    Raises:
        NoneLeft: If no proposal of a number has any weight.
        SamplingError: If too few are effective.

    Example:
        >>> from descentflow.densities.checkpoint import load_model
        >>> from descentflow.generation.conditional.constraints import Request
        >>> from descentflow.generation.conditional.latent_density import latent_density
        >>> from descentflow.generation.conditional.conditioned_density import conditioned_target
        >>> model = load_model("best.ckpt")
        >>> target = conditioned_target(Request(entry=180), latent_density(model, None), model)
        >>> found = accepted(target, 0, np.arange(50), judge_of(model.representation, 0, flown=False))
        >>> found.report.accepted, bool(model.representation.plausibility.broken_rules(found.drawn.flown).any())
        (50, False)
    """
    equal = target.proposals == 1
    pending, most, tried, rejected = np.arange(len(numbers)), np.zeros(len(numbers)), 0, 0
    broken = np.zeros(len(RULES), dtype=int)
    kept: list[Drawn] = []
    owners, effective = [], []
    for attempt in range(ROUNDS_OF_EQUALS if equal else ROUNDS):
        size, left = target.proposals * MORE**attempt, []
        for group in np.array_split(pending, -(-len(pending) * size // ROWS_AT_ONCE)):
            which = numbers[group]
            uniform = uniform_of(seed, which, size * target.width, FIRST_STREAM + attempt).reshape(-1, target.width)
            if equal and attempt < KEPT_ROUNDS:
                uniform[:, 0] = uniform_of(seed, which, 1, CELL_STREAM)[:, 0].repeat(size)
            drawn = target.draw(uniform)
            rules = judge(drawn.flown, which.repeat(size))
            log_weight = np.where(rules.any(1), -np.inf, drawn.log_weight).reshape(-1, size)
            choice = uniform_of(seed, which, 1, CHOICE_STREAM + attempt)[:, 0]
            index, share = resampled(log_weight, choice)
            enough = share >= (0.5 if equal else LEAST_EFFECTIVE)
            kept.append(drawn.subset((np.arange(len(group)) * size + index)[enough]))
            owners.append(group[enough])
            effective.append(np.ones(int(enough.sum())) if equal else share[enough])
            left.append(group[~enough])
            most[group] = share
            tried, rejected, broken = tried + len(rules), rejected + int(rules.any(1).sum()), broken + rules.sum(0)
        pending = np.concatenate(left)
        if not len(pending):
            break
    if len(pending):
        if equal or (most[pending] == 0).any():
            raise NoneLeft
        raise SamplingError(
            f"{most[pending].min():.0f} effective of {size} proposals",
            expected=f"at least {LEAST_EFFECTIVE:.0f}: what is asked together is rare among the model's descents",
            mend="ask for a band, or for less at once",
        )
    order = np.concatenate(owners).argsort(kind="stable")
    whole = Drawn(
        torch.cat([one.u for one in kept]),
        concatenate([one.flown for one in kept]),
        np.concatenate([one.log_weight for one in kept]),
    )
    n, counts = len(numbers), dict(zip(RULES, broken.tolist(), strict=True))
    report = RejectionReport(tried, n, rejected, tried - n - rejected, counts)
    return Accepted(whole.subset(order), np.concatenate(effective)[order], target.proposals, report)


def resampled(log_weight: Array, uniform: Array) -> tuple[np.ndarray, Array]:
    """One proposal for each draw by the weights (n, M) of its own, and how many effective ones there were (n,).

    Args:
        log_weight: (n, M), minus infinity where a proposal cannot be.
        uniform: (n,) in (0, 1).

    Example:
        >>> resampled(np.log([[1.0, 1.0, 2.0]]), np.array([0.9]))
        (array([2]), array([2.66666667]))
    """
    with np.errstate(invalid="ignore"):
        shares = np.exp(log_weight - log_weight.max(1, keepdims=True))
    shares = np.where(np.isfinite(shares), shares, 0.0)
    total = shares.cumsum(1)
    chosen = (total <= uniform[:, None] * total[:, -1:]).sum(1)
    with np.errstate(invalid="ignore"):
        effective = np.where(total[:, -1] > 0, total[:, -1] ** 2 / (shares**2).sum(1), 0.0)
    return np.minimum(chosen, log_weight.shape[1] - 1), effective
