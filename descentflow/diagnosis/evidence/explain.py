"""Explanation of the difference of two sides: causes with sizes, what stands beside them, and what is unknown."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import torch
from torch import Tensor

from descentflow.diagnosis.evidence.assumptions import Assumptions
from descentflow.diagnosis.evidence.best_sets import Search
from descentflow.diagnosis.evidence.candidates import Candidate, FlightsEffect, MeanEffect
from descentflow.diagnosis.evidence.flight_effects import FlightShapes, differing
from descentflow.diagnosis.evidence.moments import moments
from descentflow.diagnosis.evidence.naming import Named, name_effects, verdict_of
from descentflow.diagnosis.evidence.nuisances import lacks, layers_of_air, set_apart
from descentflow.diagnosis.evidence.set_fit import SetFit
from descentflow.diagnosis.evidence.signatures import Signatures
from descentflow.diagnosis.findings.findings import Verdict
from descentflow.diagnosis.findings.gap_found import Lack
from descentflow.diagnosis.inference.two_sides import Compared
from descentflow.effects import Effect
from descentflow.effects.effect import NOISE


@dataclass(frozen=True)
class Explanation:
    """Explanation of the flights of two sides.

    Attributes:
        verdict: See :data:`descentflow.diagnosis.findings.findings.Verdict`.
        named: Effects with their groups and probabilities.
        best: The set of the named effects, with an unknown cause where one is probable.
        sets: All that were fitted, heaviest first.
        theta: By effect of ``best``: its parameters (k,).
        errors: Standard errors of these.
        lacks: What the simulator lacks besides.

    Example:
        >>> from descentflow.diagnosis.inference.example_sides import example_sides
        >>> from descentflow.effects import EFFECTS
        >>> found = explain(example_sides(EFFECTS["temperature"], [10.0]), EFFECTS)
        >>> found.verdict, list(found.named.groups), found.theta["temperature"].round()
        ('effect', ['temperature'], tensor([10.], dtype=torch.float64))
    """

    verdict: Verdict
    named: Named
    best: SetFit
    sets: Sequence[SetFit]
    theta: Mapping[str, Tensor]
    errors: Mapping[str, Tensor]
    lacks: Sequence[Lack]


class Explainer:
    """The steps from flights of two sides to an explanation.

    Example:
        >>> from descentflow.diagnosis.inference.example_sides import example_sides
        >>> from descentflow.effects import EFFECTS
        >>> sides = example_sides(EFFECTS["temperature"], [10.0])
        >>> Explainer(sides, {"temperature": EFFECTS["temperature"]}).explanation().best.names
        ('temperature',)
    """

    def __init__(self, compared: Compared, catalogue: Mapping[str, Effect], assumed: Assumptions | None = None) -> None:
        """Take the moments and the shapes of single flights.

        Args:
            compared: Flights of both sides.
            catalogue: Effects that may be named.
            assumed: Constants; the usual ones if absent.
        """
        self.assumed = assumed or Assumptions()
        apart = set_apart(compared)
        self._aside, self.within = (compared.only(torch.nonzero(part)[:, 0]) for part in (apart, ~apart))
        self.known, self.catalogue = moments(self.within, self.assumed), catalogue
        signatures = Signatures(self.within, self.known, self.assumed)
        by_flight = differing(catalogue) if "rate" in self.within.quantities() else []
        shapes = FlightShapes(self.within, self.known, by_flight, self.assumed) if by_flight else None
        self._shapes = [] if shapes is None else shapes.candidates(signatures)
        self.groups = list({group.members: None for e in catalogue.values() if (group := e.scale_group) is not None})
        self.search = Search(self.known, self._candidates(signatures), self.assumed, exclusive=self.groups)

    def explanation(self) -> Explanation:
        """Weigh the sets and name what they say."""
        fits, sets = self.search.fits, self.search.sets()
        named = name_effects(sets, self.assumed, alike=self.groups)
        heaviest = next((one for one in sets if set(named.groups) <= set(one.names)), sets[0])
        verdict = verdict_of(named, heaviest, self.known, fits)
        has_cause = verdict in ("effect", "partial")
        names = tuple(named.groups) if has_cause else ()
        keeps_all = verdict in ("partial", "unknown")
        unknown = {q: scale for q, scale in heaviest.unknown.items() if keeps_all or q in heaviest.air}
        best = fits.fit(names, unknown, heaviest.sizes)
        return Explanation(
            verdict,
            named,
            best,
            sets,
            {name: fits.candidates[name].theta(best.sizes[name]) for name in names},
            {name: fits.candidates[name].theta_errors(best.errors[name]) for name in names},
            [
                *lacks(self._aside, self.assumed, raised=any(map(self._raises_noise, names))),
                *layers_of_air(best, self.known, fits),
            ],
        )

    def _raises_noise(self, name: str) -> bool:
        """Test for an effect that raises short-scale noise, by edges and changes of single flights or by definition."""
        effect = self.catalogue[name]
        noise = any(quantity.startswith(NOISE) for quantity in effect.shift(self.within.state, effect.start()))
        return noise or effect in differing(self.catalogue)

    def _candidates(self, signatures: Signatures) -> list[Candidate]:
        by_flight = differing(self.catalogue)
        means = [MeanEffect(e, signatures, self.assumed) for e in self.catalogue.values() if e not in by_flight]
        shapes: list[FlightsEffect] = self._shapes
        return [*(one for one in means if one.shows()), *shapes]


def explain(compared: Compared, catalogue: Mapping[str, Effect], assumed: Assumptions | None = None) -> Explanation:
    """Explain how the real flights differ from the simulator's.

    Args:
        compared: Flights of both sides.
        catalogue: Effects that may be named.
        assumed: Constants; the usual ones if absent.

    Example:
        >>> from descentflow.diagnosis.inference.example_sides import example_sides
        >>> from descentflow.effects import EFFECTS
        >>> explain(example_sides(), EFFECTS).verdict
        'none'
    """
    return Explainer(compared, catalogue, assumed).explanation()
