"""Which effects are named: forward selection with a backward pass, groups of what cannot be told apart, abstention."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import torch
from torch import Tensor

from descentflow.diagnosis.inference.aircraft_groups import by_cluster
from descentflow.diagnosis.inference.heterogeneity import spreads_as_claimed
from descentflow.diagnosis.inference.likelihood import Contest, Fit

MOST = 4
"""Effects named together at most."""
LEAST_PROMISE = 1.0
"""Gain (nats) that an effect must promise by its sensitivity alone to be fitted at all."""
LEAST_GAIN = 4.0
"""Held-out gain (nats) below which no effect is named..."""
LEAST_STANDING = 2.0
"""...nor with a gain of fewer standard errors."""
FURTHER_GAIN = 12.0
"""The same for a further effect: what the first leaves of itself must not be named..."""
FURTHER_STANDING = 2.5
FURTHER_SHARE = 0.004
"""...nor what is less than this share of the whole..."""
OVERLAP_SHARE = 0.05
"""...or than this one, where it moves the same quantities: no model of the first is exact."""
LEFT_OF_ITSELF = 0.02
"""A shift that is off by a seventh leaves so much of what it explains where it acts."""
OUTSIDE_SHARE = 0.3
"""A first effect must explain this share of what a free discrepancy explains in its place, for there may be two..."""
OUTSIDE_SHARE_AFTER = 0.7
"""...and a further one that moves the same quantities this share..."""
OUTSIDE_GAIN = 60.0
"""...where that leaves more than so many nats..."""
OUTSIDE_STANDING = 4.0
"""...and so many standard errors unexplained..."""
OUTSIDE_MOST = (25.0, 3.3)
"""...or so many, where that is more than what is explained."""
LEFT_SHARE = 0.13
"""Nor may the chosen effects together leave more than this share of the whole to a free discrepancy."""
LEAST_SIZE = 1.5
"""Mean shift, in negligible shifts of its quantity, below which no effect is named."""
SAME = 1.64
"""Effects are told apart if the better one's score is so many standard errors higher..."""
SAME_NATS = 2.0
"""...and so many nats."""
WORTH = 0.5
"""A member of the group explains at least this share of what the winner explains."""
DRAWS = 2000


@dataclass(frozen=True)
class Candidate:
    """What an effect adds to those already chosen."""

    fit: Fit
    gain: float
    error: float


@dataclass(frozen=True)
class Outside:
    """What a free discrepancy explains beyond the chosen effects, and whether it must be named."""

    explained: float
    rest: float
    error: float
    named: bool

    @property
    def share_explained(self) -> float:
        """Of what effects and discrepancy explain together."""
        whole = self.explained + max(self.rest, 0.0)
        return self.explained / whole if whole > 0 else 0.0


@dataclass(frozen=True)
class Chosen:
    """The outcome.

    ``singles`` each effect alone; ``path`` the sets in the order in which they grew; ``groups`` by chosen effect: the
    names that could stand in its place; ``probability`` of each chosen effect against those; ``gains`` of each chosen
    effect over the set without it.
    """

    null: Fit
    outside: "Outside"
    singles: dict[str, Candidate]
    fit: Fit
    groups: dict[str, tuple[str, ...]]
    probability: dict[str, float]
    gains: dict[str, tuple[float, float]]


def select(contest: Contest, discrepancy: Tensor, say: Callable[[str], None]) -> Chosen:
    """Run the contest, in which a discrepancy of no particular cause competes at every step.

    Args:
        contest: Flights and catalogue.
        discrepancy: (n, p, e) its columns, with unit prior spread.
        say: Told what is being fitted.
    """
    null = contest.fit(())
    singles: dict[str, Candidate] = {}
    promises = contest.promise(null.shift)
    for name, effect in contest.catalogue.items():
        if promises[name] < LEAST_PROMISE:
            start = effect.starts(contest.compared.state)[0]
            singles[name] = Candidate(replace(null, effects=(name,), theta={name: start}), 0.0, 0.0)
            continue
        say(f"fitting {name}")
        fit = contest.fit((name,))
        singles[name] = Candidate(fit, *contest.compare(fit.log_score, null.log_score))
    chosen = null
    candidates = singles
    while len(chosen.effects) < MOST:
        free, error = _free(contest, chosen, discrepancy)
        so_far = contest.compare(chosen.log_score, null.log_score)[0]
        best = _best(contest, candidates, chosen, so_far)
        left = free - (0.0 if best is None else best.gain)
        if _stands_out(left, error, so_far + free - left) and (
            best is None or best.gain < _share_needed(contest, best.fit) * free
        ):
            # No effect does what a shift without a cause does: adding more would only imitate it.
            break
        if best is None:
            break
        chosen = best.fit
        if len(chosen.effects) == MOST:
            break
        candidates = {}
        promises = contest.promise(chosen.shift)
        for name in contest.catalogue:
            if name not in chosen.effects and promises[name] >= LEAST_GAIN:
                say(f"fitting {name} beside {', '.join(chosen.effects)}")
                fit = contest.fit((*chosen.effects, name), chosen.theta)
                candidates[name] = Candidate(fit, *contest.compare(fit.log_score, chosen.log_score))
    chosen = _pruned(contest, chosen)
    left, error = _free(contest, chosen, discrepancy)
    explained = contest.compare(chosen.log_score, null.log_score)[0]
    outside = _stands_out(left, error, explained) and left > LEFT_SHARE * (explained + left)
    groups, probability, gains = {}, {}, {}
    for name in chosen.effects:
        rest = tuple(e for e in chosen.effects if e != name)
        say(f"what could stand for {name}")
        without = singles[rest[0]].fit if len(rest) == 1 else null if not rest else contest.fit(rest, chosen.theta)
        gains[name] = contest.compare(chosen.log_score, without.log_score)
        others = _rivals(contest, chosen, rest, singles, WORTH * gains[name][0])
        groups[name], probability[name] = _group(contest, chosen, others, without)
    return Chosen(null, Outside(explained, left, error, outside), singles, chosen, groups, probability, gains)


def size_of(contest: Contest, name: str, theta: Tensor) -> float:
    """Largest mean shift over the entries, in negligible shifts."""
    shift = contest.all_shift(name, theta)[contest.real]
    seen = contest.compared.y[contest.real].isfinite()
    mean = torch.where(seen, shift, 0.0).sum(0) / seen.sum(0).clamp(min=1)
    return float((mean.abs() / contest.compared.negligible()).max())


def _free(contest: Contest, chosen: Fit, discrepancy: Tensor) -> tuple[float, float]:
    """Held-out gain of a free discrepancy beside the chosen effects, and its standard error."""
    free = contest.held_out(chosen.shift, contest.design(chosen.theta, discrepancy, 1.0))
    return contest.compare(free, chosen.log_score)


def _stands_out(rest: float, error: float, explained: float) -> bool:
    least, standing = OUTSIDE_MOST if rest > explained else (OUTSIDE_GAIN, OUTSIDE_STANDING)
    return rest > least and rest > standing * error


def _best(contest: Contest, candidates: dict[str, Candidate], chosen: Fit, so_far: float) -> Candidate | None:
    """The candidate of the largest gain that counts, if any."""
    for candidate in sorted(candidates.values(), key=lambda c: -c.gain):
        if candidate.gain < LEAST_GAIN:
            return None
        name = candidate.fit.effects[-1]
        theta = candidate.fit.theta[name]
        counts = (
            _counts_first(contest, candidate)
            if not chosen.effects
            else _counts_further(contest, candidate, chosen, so_far)
        )
        if counts and _credible(contest, candidate.fit, name) and size_of(contest, name, theta) >= LEAST_SIZE:
            return candidate
    return None


def _credible(contest: Contest, fit: Fit, name: str) -> bool:
    """Whether parameters and spread between flights can be what the effect says."""
    plausible = contest.catalogue[name].plausible(contest.compared.state, fit.theta[name])
    return plausible and spreads_as_claimed(contest, fit, name)


def _counts_first(contest: Contest, candidate: Candidate) -> bool:
    # Against samples, which are coarser than flights, a first effect has to show as much as a further one.
    least = LEAST_GAIN if contest.compared.slack == 1.0 else FURTHER_GAIN
    return candidate.gain >= least and candidate.gain >= LEAST_STANDING * candidate.error


def _counts_further(contest: Contest, candidate: Candidate, chosen: Fit, so_far: float) -> bool:
    """Whether it is worth it as a whole, or in one of two parts by itself.

    What the chosen effects leave of themselves lies where they act. So a further one may show elsewhere, or where they
    act too: there it is held against what they explain there, and not against all that they explain.
    """
    if candidate.gain < FURTHER_GAIN or candidate.gain < FURTHER_STANDING * candidate.error:
        return False
    share = OVERLAP_SHARE if _overlaps(contest, candidate.fit) else FURTHER_SHARE
    if candidate.gain >= share * so_far:
        return True
    own = _acts(contest, candidate.fit, candidate.fit.effects[-1])
    taken = torch.stack([_acts(contest, chosen, name) for name in chosen.effects]).any(0)
    elsewhere = _counts_in(contest, own & ~taken, candidate.fit, chosen, FURTHER_SHARE * so_far)
    return elsewhere or _counts_in(contest, own & taken, candidate.fit, chosen, 0.0)


def _counts_in(contest: Contest, part: Tensor, fit: Fit, chosen: Fit, least: float) -> bool:
    """Whether a further effect is worth it in some entries (p,) alone."""
    at = torch.nonzero(part)[:, 0]
    if not len(at):
        return False
    scores = [contest.held_out_in(at, theta) for theta in ({}, chosen.theta, fit.theta)]
    before = contest.compare(scores[1], scores[0])[0]
    gain, error = contest.compare(scores[2], scores[1])
    return gain >= max(FURTHER_GAIN, least, LEFT_OF_ITSELF * before) and gain >= FURTHER_STANDING * error


def _share_needed(contest: Contest, fit: Fit) -> float:
    return OUTSIDE_SHARE_AFTER if len(fit.effects) > 1 and _overlaps(contest, fit) else OUTSIDE_SHARE


def _overlaps(contest: Contest, fit: Fit) -> bool:
    """Whether the last effect moves a quantity that the others move."""
    *others, last = (_moved(contest, fit, name) for name in fit.effects)
    return any(last & other for other in others)


def _moved(contest: Contest, fit: Fit, name: str) -> set[str]:
    """Quantities in which an effect acts."""
    acts = _acts(contest, fit, name).tolist()
    return {e.quantity for e, there in zip(contest.compared.entries, acts, strict=True) if there}


def _acts(contest: Contest, fit: Fit, name: str) -> Tensor:
    """Entries (p,) whose mean an effect moves by something that matters."""
    shift = contest.all_shift(name, fit.theta[name])[contest.real].mean(0)
    return shift.abs() > contest.compared.negligible()


def _pruned(contest: Contest, chosen: Fit) -> Fit:
    """Without effects that later ones have made needless."""
    while len(chosen.effects) > 1:
        weakest, loss = None, float("inf")
        for name in chosen.effects:
            fit = contest.fit([e for e in chosen.effects if e != name], chosen.theta)
            gain, error = contest.compare(chosen.log_score, fit.log_score)
            needless = gain < FURTHER_GAIN or gain < FURTHER_STANDING * error
            if needless and gain < loss:
                weakest, loss = fit, gain
        if weakest is None:
            return chosen
        chosen = weakest
    return chosen


def _rivals(
    contest: Contest, chosen: Fit, rest: Sequence[str], singles: dict[str, Candidate], worth: float
) -> dict[str, Fit]:
    """Other effects in the place of a chosen one, where they promise to be worth it."""
    others = [e for e in contest.catalogue if e not in chosen.effects]
    if not rest:
        return {e: singles[e].fit for e in others}
    start = {e: chosen.theta[e] for e in rest}
    promises = contest.promise(contest.shift(start))
    return {e: contest.fit((*rest, e), start) for e in others if promises[e] >= 0.5 * worth}


def _group(contest: Contest, chosen: Fit, others: dict[str, Fit], without: Fit) -> tuple[tuple[str, ...], float]:
    """Names that do as well, and the share of resampled fleets in which the chosen one does best."""
    worth = WORTH * contest.compare(chosen.log_score, without.log_score)[0]
    same = []
    totals = [by_cluster(chosen.log_score, contest.compared.cluster)]
    for name, fit in others.items():
        lead, error = contest.compare(chosen.log_score, fit.log_score)
        gain = contest.compare(fit.log_score, without.log_score)[0]
        if _credible(contest, fit, name) and gain >= worth and (lead < SAME * error or lead < SAME_NATS):
            same.append(name)
        totals.append(by_cluster(fit.log_score, contest.compared.cluster))
    scores = torch.stack(totals)
    generator = torch.Generator().manual_seed(0)
    # Rubin's Bayesian bootstrap over aircraft.
    weights = -torch.rand(scores.shape[1], DRAWS, generator=generator, dtype=torch.float64).clamp(min=1e-12).log()
    wins = (scores @ weights).argmax(0) == 0
    return tuple(same), float(wins.double().mean())
