"""The search among sets of effects: all of up to four are screened, the best fitted, and others grown from them."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import torch
from torch import Tensor

from descentflow.core.freed_memory import give_back
from descentflow.diagnosis.inference.aircraft_groups import by_aircraft
from descentflow.diagnosis.inference.credible import is_credible
from descentflow.diagnosis.inference.discrepancy import DiscrepancyColumns
from descentflow.diagnosis.inference.free_discrepancy import FreeDiscrepancy
from descentflow.diagnosis.inference.inclusion import Names, WeightedSet, inclusion
from descentflow.diagnosis.inference.likelihood import EffectsLikelihood, Fit
from descentflow.diagnosis.inference.linear_algebra import Design
from descentflow.diagnosis.inference.mixed_fit import design_with_laws, without_laws
from descentflow.diagnosis.inference.model_weights import weights_of
from descentflow.diagnosis.inference.screened_scores import BothScores, screened_scores
from descentflow.diagnosis.inference.search import first_guess, fit_effects
from descentflow.diagnosis.inference.set_growth import others_beside, promised_beside
from descentflow.diagnosis.inference.single_effects import Candidate
from descentflow.diagnosis.inference.subset_screening import Member, member_of
from descentflow.effects.flight_law import DiffersByFlight

MANY_NUMBERS = 200_000
"""Numbers measured in all flights from which memory is given back after each fit; of fewer it is little."""
LOG_PRIOR_ODDS = -2.5
"""Of each effect, and of a shift that none of them makes: one of the fourteen is expected where there is a gap."""
FIRST = 4
"""Screened sets that are fitted at most, those that promise most first; from the best of them sets grow."""
WITH_DISCREPANCY = 6
"""Sets that are tried with a discrepancy beside them at most."""
MOST_GROWN = 5
"""Effects that a set may grow to: one more than any diagnosis of the sealed study named."""
SCREENED_GAP = 8.0
"""Nats by which a set's linear gain may fall short of the best for it to be refitted: its weight would be e^-8."""


class SetSearch:
    """Sets of effects: screened, fitted, grown, weighted.

    Example:
        >>> from descentflow.diagnosis.inference.example_sides import example_likelihood
        >>> from descentflow.diagnosis.inference.discrepancy import discrepancy_columns
        >>> from descentflow.diagnosis.inference.search import fit_effects
        >>> from descentflow.diagnosis.inference.single_effects import every_single
        >>> from descentflow.effects import EFFECTS
        >>> likelihood = example_likelihood(EFFECTS["temperature"], [10.0])
        >>> columns = discrepancy_columns(likelihood.compared)
        >>> null = fit_effects(likelihood, ())
        >>> singles = every_single(likelihood, null, lambda stage: None)
        >>> sets, _ = SetSearch(likelihood, columns, null, singles, lambda stage: None).weighted()
        >>> max(sets, key=lambda one: one.weight).effects
        ('temperature',)
    """

    def __init__(
        self,
        likelihood: EffectsLikelihood,
        discrepancy: DiscrepancyColumns,
        null: Fit,
        singles: Mapping[str, Candidate],
        progress: Callable[[str], None],
    ) -> None:
        """Begin with the effects alone."""
        self.likelihood, self.progress = likelihood, progress
        self.discrepancy = FreeDiscrepancy(likelihood, discrepancy)
        self._credible: dict[Names, Names] = {}
        self.fits: dict[frozenset[str], Fit] = {frozenset(): null}
        for name, single in singles.items():
            if single.fit.kept is not null.kept:
                self.fits[frozenset([name])] = single.fit
        self.start = {name: single.fit.theta[name] for name, single in singles.items()}
        self.costs: dict[Names, float] = {}
        self.promised: dict[Names, dict[str, float]] = {}
        self.lack: dict[str, float] = {}
        self.scores: dict[tuple[tuple[Member, ...], Names], BothScores] = {}

    def weighted(self) -> tuple[list[WeightedSet], list[WeightedSet]]:
        """Sets that were refitted, with weights: with and without a discrepancy beside each, and without one alone."""
        self.progress("screening sets of effects")
        members = [member_of(self.likelihood, name, theta) for name, theta in self.start.items()]
        law = self._first_law()
        beside = law or self._explored(members, self.fit(()), at_most=FIRST)
        members += self._beside(beside)
        if law is not None:
            self._explored(members, law, at_most=FIRST)
        return self._grown()

    def _best(self) -> Fit:
        return max(self._credible_fits(), key=self._score)

    def _grown(self) -> tuple[list[WeightedSet], list[WeightedSet]]:
        """Weights, once nothing that is near the best set is left to be fitted."""
        while True:
            sets, alone = self._weighed()
            best = inclusion(sets, alone).best
            # A set that grows is looked at from all sides once it has stopped growing, and without each of its effects
            # once it is known which of those that scale one equation it has.
            larger, exchanged = self._untried(self._with_another(best)), self._untried(self._exchanged(best))
            smaller = self._untried(self._smaller(best))
            wanted, start = larger[:1] or exchanged or smaller, self.fit(best).theta
            if not wanted:
                return sets, alone
            # While the best stays the best, all of these will be asked for.
            for names in wanted:
                self._credible_part(self.fit(names, start))

    def _untried(self, sets: Sequence[Names]) -> list[Names]:
        return [names for names in sets if frozenset(names) not in self.fits]

    def _smaller(self, heaviest: Names) -> list[Names]:
        """The best set without each of its effects: what one adds is asked of fits and not of the screening."""
        return [tuple(other for other in heaviest if other != name) for name in heaviest]

    def _exchanged(self, heaviest: Names) -> list[Names]:
        """The best set with another effect that scales the same equation in the place of one of its own.

        What an effect cannot be told from is asked of fits too.
        """
        found = []
        for name in heaviest:
            group = self.likelihood.catalogue[name].scale_group
            for other in () if group is None else group.members:
                if other in self.likelihood.catalogue and other not in heaviest:
                    found.append(tuple(other if one == name else one for one in heaviest))
        return found

    def _with_another(self, heaviest: Names) -> list[Names]:
        """The best set with one more effect, where that promises more than it costs; what promises most first.

        Beside another set an effect promised something too; what of that it did not keep is taken off.
        """
        if len(heaviest) >= MOST_GROWN:
            return []
        fit = self.fit(heaviest)
        if heaviest not in self.promised:
            others = others_beside(self.likelihood, fit, self.start)
            self.start |= others
            self.promised[heaviest] = promised_beside(self.likelihood, self.discrepancy, fit, others, LOG_PRIOR_ODDS)
        promised = self.promised[heaviest]
        for name, nats in promised.items():
            tried = self.fits.get(frozenset((*heaviest, name)))
            if tried is not None:
                kept = self._score(tried) - self._score(fit) if self._credible_part(tried) is tried else 0.0
                self.lack[name] = nats - min(kept, nats)
        left = {name: nats - self.lack.get(name, 0.0) for name, nats in promised.items()}
        return [(*heaviest, name) for name in sorted(left, key=lambda name: -left[name]) if left[name] > 0]

    def _weighed(self) -> tuple[list[WeightedSet], list[WeightedSet]]:
        """All that were fitted and are credible, with their weights."""
        usable = self._credible_fits()
        usable.sort(key=lambda f: -float(f.log_score.sum()) - LOG_PRIOR_ODDS * len(f.effects))
        alone = [(f, False) for f in usable]
        beside = [(f, True) for at, f in enumerate(usable) if at < WITH_DISCREPANCY or not f.effects]
        scores, prior = [], []
        for f, free in (*alone, *beside):
            score = self.discrepancy.beside(f).log_score if free else f.log_score
            scores.append(by_aircraft(score, self.likelihood.compared.airframe))
            prior.append(LOG_PRIOR_ODDS * (len(f.effects) + free) - self._cost(f, free))
        every, log_prior = torch.stack(scores), torch.tensor(prior, dtype=torch.float64)
        first = len(alone)
        return (
            _weighted((*alone, *beside), weights_of(every, log_prior)),
            _weighted(alone, weights_of(every[:first], log_prior[:first])),
        )

    def _explored(self, members: Sequence[Member], beside: Fit, at_most: int) -> Fit:
        """The best credible fit, after so many sets at most were fitted, those that promise most first."""
        for _ in range(at_most):
            screened = self._screened(members, beside)
            untried = self._untried(list(screened))
            if not untried or screened[untried[0]] >= SCREENED_GAP:
                break
            laws = set(beside.per_flight)
            wanted = self._untried_parts(untried[0], laws)
            self._credible_part(self.fit(wanted[0]))
        return self._best()

    def _untried_parts(self, names: Names, laws: set[str]) -> list[Names]:
        """Parts of a set that are to be fitted in turn, itself last: a core, and the core with one effect more.

        The core are laws that are known, or else the effects that all flights have alike. What a mean shift gains
        beside them may be theirs, or nothing, once each flight is asked.
        """
        catalogue = self.likelihood.catalogue
        alike = {name for name in names if not isinstance(catalogue[name], DiffersByFlight)}
        core = laws if laws and laws < set(names) else alike
        parts = [tuple(n for n in names if n in core)]
        parts += [tuple(n for n in names if n in core or n == other) for other in names if other not in core]
        return self._untried([part for part in dict.fromkeys(parts) if part and part != names] + [names])

    def _score(self, fit: Fit) -> float:
        """What the search holds against each other: held-out log score with priors, the better of with and without."""
        prior = LOG_PRIOR_ODDS * len(fit.effects)
        beside = self.discrepancy.beside(fit)
        plain = float(fit.log_score.sum()) - self._cost(fit, free=False)
        return prior + max(plain, float(beside.log_score.sum()) - beside.cost + LOG_PRIOR_ODDS)

    def _credible_fits(self) -> list[Fit]:
        """All that are credible, the credible parts of the others among them."""
        for fit in list(self.fits.values()):
            self._credible_part(fit)
        return [fit for fit in self.fits.values() if self._credible_part(fit) is fit]

    def _credible_part(self, fit: Fit) -> Fit:
        """The fit without effects that cannot be what they say, fitted again until all can."""
        while True:
            if fit.effects not in self._credible:
                self._credible[fit.effects] = self._credible_names(fit)
            kept = self._credible[fit.effects]
            if kept == fit.effects:
                return fit
            fit = self.fit(kept)

    def _credible_names(self, fit: Fit) -> Names:
        return tuple(name for name in fit.effects if is_credible(self.likelihood, fit, name))

    def fit(self, names: Sequence[str], start: Mapping[str, Tensor] | None = None) -> Fit:
        """The fit of a set, made once; from the parameters of another fit, where these are given."""
        key = frozenset(names)
        if key not in self.fits:
            self.progress(f"fitting {', '.join(names)}")
            self.fits[key] = self._fitted(tuple(names), self._begin(names, start or {}))
        found = self.fits[key]
        return found if found.effects == tuple(names) else _reordered(self.likelihood, found, tuple(names))

    def _fitted(self, names: Names, start: Mapping[str, Tensor]) -> Fit:
        """A fit, after which memory is given back where there is much of it."""
        fit = fit_effects(self.likelihood, names, start)
        if self.likelihood.y.numel() > MANY_NUMBERS:
            give_back()
        return fit

    def fits_of(self, sets: Sequence[Names]) -> list[Fit]:
        """Fits of several sets, each as :meth:`fit` makes it."""
        return [self.fit(names) for names in sets]

    def _begin(self, names: Sequence[str], start: Mapping[str, Tensor]) -> dict[str, Tensor]:
        """Parameters from which the fit of a set starts: those of another fit, where it has the effect."""
        return {name: start.get(name, self.start[name]) for name in names}

    def _cost(self, fit: Fit, free: bool) -> float:
        """Nats by which what a set says of its signatures, and of a discrepancy, is improbable."""
        if free:
            return self.discrepancy.beside(fit).cost
        if fit.effects not in self.costs:
            self.costs[fit.effects] = self.likelihood.improbability(fit.shift, fit.design)
        return self.costs[fit.effects]

    def _screened(self, members: Sequence[Member], beside: Fit) -> dict[Names, float]:
        """Sets that none of their effects could be taken out of without loss, best first, and what each is short of.

        That is the promise of the set that promises most (nats).

        Without a discrepancy, and with one that is as wide as it is beside some fit. A set promises no more than its
        parts have kept of what they promised, and nothing where one of them was not credible.
        """
        plain, free = self._scores(members, beside)
        found = self._with_prior(plain, 0.0)
        part = self._with_prior(free, LOG_PRIOR_ODDS - self.discrepancy.beside(beside).cost)
        found = {names: max(found[names], part[names]) for names in found}
        short: dict[frozenset[str], float] = {}
        for fitted, fit in list(self.fits.items()):
            promised = found.get(tuple(sorted(fitted)))
            if promised is not None and len(fitted) > 1:
                credible = self._credible_part(fit) is fit
                short[fitted] = self._score(fit) - promised if credible else -torch.inf
        kept: dict[Names, float] = {}
        for names, score in found.items():
            kept[names] = score + min((lack for fitted, lack in short.items() if fitted <= set(names)), default=0.0)
        most = max(kept.values())
        short_of = {names: most - score for names, score in kept.items() if _is_whole(names, found)}
        return dict(sorted(short_of.items(), key=lambda pair: pair[1]))

    def _first_law(self) -> Fit | None:
        """The effect that explains most by itself, if flights have it each in their own way: others show beside it."""
        alone = [fit for fit in self._credible_fits() if len(fit.effects) == 1]
        best = max(alone, key=lambda fit: float(fit.log_score.sum()), default=None)
        return best if best is not None and best.per_flight else None

    def _scores(self, members: Sequence[Member], beside: Fit) -> BothScores:
        """Screened scores of all sets beside a fit, worked out once."""
        key = tuple(members), beside.effects
        if key not in self.scores:
            cost = self._cost(beside, free=False)
            self.scores[key] = screened_scores(self.likelihood, self.discrepancy, members, beside, cost)
        return self.scores[key]

    def _with_prior(self, scores: Mapping[Names, float], more: float) -> dict[Names, float]:
        return {names: score + LOG_PRIOR_ODDS * len(names) + more for names, score in scores.items()}

    def _beside(self, fit: Fit) -> list[Member]:
        """Effects of a set about their parameters in it, and windowed ones about the best window beside it."""
        found = [member_of(self.likelihood, name, theta) for name, theta in fit.theta.items()]
        self.start |= fit.theta
        if len(fit.effects) == 0:
            return found
        for name in self.likelihood.catalogue:
            if name in fit.effects or self.likelihood.windowed(name) is None:
                continue
            if fit.per_flight:
                alike = {other: theta for other, theta in fit.theta.items() if other not in fit.per_flight}
                guess = first_guess(without_laws(self.likelihood, fit), name, alike)
                found.append(member_of(self.likelihood, name, guess))
            else:
                self.progress(f"fitting {name} beside {', '.join(fit.effects)}")
                other = self._fitted((*fit.effects, name), fit.theta)
                self.fits[frozenset(other.effects)] = other
                self.start[name] = other.theta[name]
                found.append(member_of(self.likelihood, name, other.theta[name]))
        return found


def _weighted(fits: Sequence[tuple[Fit, bool]], weights: Tensor) -> list[WeightedSet]:
    return [WeightedSet(fit.effects, free, w) for (fit, free), w in zip(fits, weights.tolist(), strict=True)]


def _is_whole(names: Names, scores: Mapping[Names, float]) -> bool:
    """Whether every effect of a set gains more than it costs."""
    smaller = [tuple(other for other in names if other != name) for name in names]
    return all(scores[fewer] < scores[names] for fewer in smaller)


def _reordered(likelihood: EffectsLikelihood, fit: Fit, names: Names) -> Fit:
    """The same fit with its effects in another order."""
    theta = {name: fit.theta[name] for name in names}

    def design() -> Design:
        return design_with_laws(likelihood, theta, fit.per_flight) if fit.per_flight else likelihood.design(theta)

    return replace(fit, effects=names, theta=theta, kept=likelihood.kept(design))
