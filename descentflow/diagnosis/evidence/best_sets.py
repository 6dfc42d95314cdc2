"""Search for the sets of effects that carry the weight: screening of all small ones, fits of the best, growth."""

import itertools
from collections.abc import Sequence

import numpy as np

from descentflow.diagnosis.evidence.assumptions import Assumptions
from descentflow.diagnosis.evidence.candidates import Candidate, Linearised
from descentflow.diagnosis.evidence.moments import Moments
from descentflow.diagnosis.evidence.set_fit import Names, SetFit, SetFits

MOST_ENUMERATED = 3
"""Effects of the sets that are all screened; larger ones are grown."""
HEAVIEST = 20
"""Sets that are fitted; half as many with an unknown cause beside them."""


class Search:
    """All sets of a catalogue's effects.

    Example:
        >>> from descentflow.diagnosis.evidence.candidates import MeanEffect
        >>> from descentflow.diagnosis.evidence.moments import moments
        >>> from descentflow.diagnosis.evidence.signatures import Signatures
        >>> from descentflow.diagnosis.inference.example_sides import example_sides
        >>> from descentflow.effects import EFFECTS
        >>> sides, assumed = example_sides(EFFECTS["temperature"], [10.0]), Assumptions()
        >>> known = moments(sides, assumed)
        >>> signatures = Signatures(sides, known, assumed)
        >>> names = ("temperature", "mass", "wind_gradient")
        >>> found = Search(known, [MeanEffect(EFFECTS[name], signatures, assumed) for name in names], assumed).sets()
        >>> found[0].names, found[0].sizes["temperature"].round()
        (('temperature',), array([10.]))
    """

    def __init__(
        self,
        known: Moments,
        candidates: Sequence[Candidate],
        assumed: Assumptions,
        exclusive: Sequence[Sequence[str]] = (),
    ) -> None:
        """Linearise every candidate at the size that it has alone.

        Args:
            known: Moments of both sides.
            candidates: Effects that may be causes.
            assumed: Constants.
            exclusive: Groups of names of which a set has one at most.
        """
        self.known, self.assumed, self.exclusive = known, assumed, [set(group) for group in exclusive]
        self.fits = SetFits(known, candidates, assumed)
        self._alone = {one.name: self.fits.fit((one.name,)).sizes[one.name] for one in candidates}
        linear = [Linearised(one, self._alone[one.name]) for one in candidates]
        self._screen = SetFits(known, linear, assumed)

    def sets(self) -> list[SetFit]:
        """The sets that matter, at plausible sizes, heaviest first."""
        fitted = {names: self.fits.fit(names, first=self._alone) for names in self._heaviest()}
        self._grow(fitted)
        ordered = sorted(fitted.values(), key=lambda one: -one.log_weight)
        small = [one for one in ordered if len(one.names) <= 1]
        for one in {fit.names: fit for fit in (*ordered[: HEAVIEST // 2], *small[: HEAVIEST // 2])}.values():
            in_air = self._with_unknown(one, air=True)
            ordered += [in_air, self._with_unknown(in_air, air=False)]
        found = {(one.names, *one.unknown.items()): one for one in filter(self.plausible, ordered)}
        return sorted(found.values(), key=lambda one: -one.log_weight)

    def _with_unknown(self, fit: SetFit, *, air: bool) -> SetFit:
        """A set with what else is likeliest to move the means; itself where nothing does."""
        scales = self.fits.unknown_scales(fit, air=air)
        return fit if scales == fit.unknown else self.fits.fit(fit.names, scales, fit.sizes)

    def plausible(self, fit: SetFit) -> bool:
        """True if every effect may have its size, and moves some mean by more than what is negligible."""
        for name in fit.names:
            moved = np.abs(fit.shifts[name] / self.known.negligible).max()
            if moved < self.assumed.least_shift or not self.fits.candidates[name].plausible(fit.sizes[name]):
                return False
        return True

    def _allowed(self, names: Sequence[str]) -> bool:
        return all(len(group.intersection(names)) <= 1 for group in self.exclusive)

    def _heaviest(self) -> list[Names]:
        """Sets that weigh most where all is linear, and the empty one."""
        every = (itertools.combinations(self.fits.candidates, count) for count in range(MOST_ENUMERATED + 1))
        allowed = [names for names in itertools.chain(*every) if self._allowed(names)]
        weight = {names: self._screen.fit(names, rounds=1).log_weight for names in allowed}
        return list(dict.fromkeys([*sorted(allowed, key=lambda names: -weight[names])[:HEAVIEST], ()]))

    def _grow(self, fitted: dict[Names, SetFit]) -> None:
        """Add the best further effect to the heaviest set, as long as that makes it heavier."""
        while True:
            best = max(fitted.values(), key=lambda one: one.log_weight)
            if len(best.names) < MOST_ENUMERATED:
                return
            larger = [(*best.names, name) for name in self.fits.candidates if name not in best.names]
            first = {**self._alone, **best.sizes}
            grown = [self.fits.fit(names, first=first) for names in larger if self._allowed(names)]
            heavier = [one for one in grown if one.log_weight > best.log_weight and self.plausible(one)]
            if not heavier:
                return
            top = max(heavier, key=lambda one: one.log_weight)
            fitted[top.names] = top
