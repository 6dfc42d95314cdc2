"""Draws until each is plausible: one after another in closed form, among weighted proposals otherwise."""

from dataclasses import dataclass

import numpy as np

from descentflow.core.errors import SamplingError
from descentflow.generation.conditional.flown_profiles import Array
from descentflow.generation.conditional.judged_draws import Judge
from descentflow.generation.conditional.latent_draws import Drawn, Numbers, Target, joined, resampled, rows_of
from descentflow.representation.plausibility import RULES

MOST_TRIES = 256
"""Draws of one number after which nothing counts as plausible: where one in 20 is, so many fail once in 500,000."""
MOST_AT_ONCE = 16
"""Tries of one number that are made together once the first few failed."""
PROPOSALS, PROPOSALS_OF_A_STAND_IN = 16, 256
"""Proposals for one draw; more where Gaussians stand in for a density that is no mixture."""
MORE, ROUNDS = 4, 4
"""Factor by which proposals grow where too few were effective, and its largest number of uses."""
LEAST_EFFECTIVE = 8.0
"""Effective proposals that a draw is chosen among, at least."""
ROWS_AT_ONCE = 4096
"""Proposals flown at a time."""
CHOICE_STREAM = 1 << 20
"""Stream of the numbers that choose among proposals."""


@dataclass(frozen=True)
class Accepted:
    """n draws and the account of all tries.

    Attributes:
        drawn: The n draws.
        effective: (n,) how many proposals were effective for each.
        proposals: How many were made for each, at first.
        tried: Draws made for all of them, those that broke a rule and, among weighted ones, those not chosen as well.
        rejected: Those that broke a rule.
        broken: How many broke each rule; one may break several.

    Example:
        >>> from descentflow.densities.checkpoint import load_model
        >>> from descentflow.generation.conditional.conditioned_density import conditioned_target
        >>> from descentflow.generation.conditional.entry_shares import EntryShares
        >>> from descentflow.generation.conditional.flown_profiles import FlownProfiles
        >>> from descentflow.generation.conditional.judged_draws import DrawnDescents
        >>> from descentflow.generation.conditional.latent_parts import parts_of
        >>> from descentflow.generation.conditional.requests import Request
        >>> model = load_model("best.ckpt")
        >>> parts, grid = model.representation, FlownProfiles(model.representation.decoder)
        >>> request, bounds = Request(entry=grid.nearest(330)), parts.plausibility
        >>> target = conditioned_target(request, parts_of(model, grid, None), grid, EntryShares(model), bounds)
        >>> judge = DrawnDescents(parts, grid, seed=0).broken
        >>> accepted = first_plausible(target, Numbers(seed=0, first=0), 50, judge)
        >>> accepted.tried - accepted.rejected, bool(judge(accepted.drawn, np.arange(50)).any())
        (50, False)
    """

    drawn: Drawn
    effective: Array
    proposals: int
    tried: int
    rejected: int
    broken: dict[str, int]


class NoneLeft(Exception):
    """No draw of a number is plausible; see :func:`first_plausible` for an example."""


def first_plausible(target: Target, numbers: Numbers, n: int, judge: Judge) -> Accepted:
    """The first plausible try of each of n numbers.

    Args:
        target: What is drawn from, every draw of the same weight.
        numbers: Of the draws.
        n: How many.
        judge: Which rules draws break.

    Raises:
        NoneLeft: If a number has none among :data:`MOST_TRIES`.

    Example:
        >>> from descentflow.generation.conditional.point_condition import Flown
        >>> class Even:
        ...     width = 1
        ...
        ...     def draw(self, u):
        ...         flown = Flown(*(np.zeros((len(u), 1)) for _ in range(6)))
        ...         return Drawn(u, np.zeros(len(u), int), flown, np.zeros(len(u)))
        >>> above = lambda drawn, which: np.repeat(drawn.u > 0.25, len(RULES), 1)
        >>> found = first_plausible(Even(), Numbers(seed=0, first=0), 100, above)
        >>> bool(found.drawn.u.max() <= 0.25), found.tried - found.rejected
        (True, 100)
        >>> all_of_them = lambda drawn, which: np.ones((len(which), len(RULES)), bool)
        >>> first_plausible(Even(), Numbers(seed=0, first=0), 100, all_of_them)
        Traceback (most recent call last):
        descentflow.generation.conditional.accepted.NoneLeft
    """
    pending, stream, size = np.arange(n), 0, 1
    parts, owners, tried, rejected, broken = [], [], 0, 0, np.zeros(len(RULES), dtype=int)
    while len(pending):
        if stream >= MOST_TRIES:
            raise NoneLeft
        tries = [numbers.uniform(n, target.width, stream + k)[pending] for k in range(size)]
        drawn = target.draw(np.stack(tries, 1).reshape(-1, target.width))
        rules = judge(drawn, np.repeat(numbers.first + pending, size))
        bad = rules.any(1).reshape(-1, size)
        first = np.where(bad.all(1), size, bad.argmin(1))
        hit = np.flatnonzero(first < size)
        # Tries after the one that is taken were never made, as far as anyone can tell.
        made = np.arange(size) <= first[:, None]
        tried, rejected = tried + int(made.sum()), rejected + int((bad & made).sum())
        broken += (rules & made.reshape(-1, 1)).sum(0)
        parts.append(rows_of(drawn, hit * size + first[hit]))
        owners.append(pending[hit])
        pending, stream = np.delete(pending, hit), stream + size
        size = min(2 * size if stream > 1 else 1, MOST_AT_ONCE)
    order = np.concatenate(owners).argsort(kind="stable")
    whole = parts[0] if len(parts) == 1 else rows_of(joined(parts), order)
    counts = dict(zip(RULES, broken.tolist(), strict=True))
    return Accepted(whole, np.ones(n), 1, tried, rejected, counts)


def chosen_by_weight(target: Target, numbers: Numbers, n: int, judge: Judge, stand_in: bool) -> Accepted:
    """For each of n numbers one of its own plausible proposals, by weight.

    Args:
        target: What is drawn from.
        numbers: Of the draws.
        n: How many.
        judge: Which rules proposals break.
        stand_in: Whether Gaussians stand in for a density that is no mixture, which takes more proposals.

    Raises:
        NoneLeft: If no proposal of a number has any weight.
        SamplingError: If too few are effective.

    Example:
        >>> from descentflow.generation.conditional.point_condition import Flown
        >>> class Rising:
        ...     width = 1
        ...
        ...     def draw(self, u):
        ...         flown = Flown(*(np.zeros((len(u), 1)) for _ in range(6)))
        ...         return Drawn(u, np.zeros(len(u), int), flown, np.log(u[:, 0]))
        >>> no_rule = lambda drawn, which: np.zeros((len(which), len(RULES)), bool)
        >>> found = chosen_by_weight(Rising(), Numbers(seed=0, first=0), 1000, no_rule, stand_in=True)
        >>> bool(abs(found.drawn.u.mean() - 2 / 3) < 0.03)  # of the density 2u; four standard errors
        True
        >>> round(float(found.effective.mean()) / found.proposals, 2)  # 3/4 for this density
        0.75
    """
    size, pending = PROPOSALS_OF_A_STAND_IN if stand_in else PROPOSALS, np.arange(n)
    fewest = size
    parts, owners, effective = [], [], []
    tried, rejected, broken, most = 0, 0, np.zeros(len(RULES), dtype=int), np.zeros(n)
    for attempt in range(ROUNDS):
        left = []
        for group in np.array_split(pending, max(-(-len(pending) * size // ROWS_AT_ONCE), 1)):
            drawn, rules = _proposed(target, numbers, group, size, attempt, judge)
            log_weight = np.where(rules.any(1), -np.inf, drawn.log_weight).reshape(-1, size)
            choice = np.concatenate(
                [Numbers(numbers.seed, numbers.first + int(i)).uniform(1, 1, CHOICE_STREAM + attempt) for i in group]
            )
            index, share = resampled(log_weight, choice[:, 0])
            enough = share >= LEAST_EFFECTIVE
            parts.append(rows_of(drawn, (np.arange(len(group)) * size + index)[enough]))
            owners.append(group[enough])
            effective.append(share[enough])
            left.append(group[~enough])
            most[group] = share
            tried, rejected = tried + len(rules), rejected + int(rules.any(1).sum())
            broken += rules.sum(0)
        pending = np.concatenate(left)
        if not len(pending):
            break
        size *= MORE
    if len(pending):
        if (most[pending] == 0).any():
            raise NoneLeft
        raise SamplingError(
            f"{most[pending].min():.0f} effective of {size // MORE} proposals",
            expected=f"at least {LEAST_EFFECTIVE:.0f}: what is asked together is rare among the model's descents",
            mend="ask for a band, or for less at once",
        )
    order = np.concatenate(owners).argsort(kind="stable")
    counts = dict(zip(RULES, broken.tolist(), strict=True))
    whole = rows_of(joined(parts), order)
    return Accepted(whole, np.concatenate(effective)[order], fewest, tried, rejected, counts)


def _proposed(
    target: Target, numbers: Numbers, group: np.ndarray, size: int, attempt: int, judge: Judge
) -> tuple[Drawn, np.ndarray]:
    """Proposals of some numbers, ``size`` for each, and the rules that they break."""
    uniform = [
        Numbers(numbers.seed, (numbers.first + int(i)) * size).uniform(size, target.width, attempt) for i in group
    ]
    drawn = target.draw(np.concatenate(uniform))
    return drawn, judge(drawn, np.repeat(numbers.first + group, size))
