"""Explanation of the difference of two sides: causes with sizes, what stands beside them, and what is unknown."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import torch

from descentflow.diagnosis.evidence.assumptions import Assumptions
from descentflow.diagnosis.evidence.best_sets import Search
from descentflow.diagnosis.evidence.candidates import Candidate, FlightsEffect, MeanEffect
from descentflow.diagnosis.evidence.flight_effects import FlightShapes, differing
from descentflow.diagnosis.evidence.moments import Moments, moments
from descentflow.diagnosis.evidence.naming import Named, name_effects, verdict_of
from descentflow.diagnosis.evidence.nuisances import Lack, lacks, set_apart
from descentflow.diagnosis.evidence.set_fit import SetFit
from descentflow.diagnosis.evidence.signatures import Signatures
from descentflow.diagnosis.findings.findings import Verdict
from descentflow.diagnosis.inference.two_sides import Compared
from descentflow.effects import Effect


@dataclass(frozen=True)
class Explanation:
    """What the flights of two sides say.

    Attributes:
        verdict: See :data:`descentflow.diagnosis.findings.findings.Verdict`.
        named: Effects with their groups and probabilities.
        best: The heaviest set with all that is named.
        sets: All that were fitted, heaviest first.
        shapes: By effect that some flights have: its law.
        lacks: What the simulator lacks besides.
        known: Moments of both sides.

    Example:
        >>> from descentflow.diagnosis.inference.example_sides import example_sides
        >>> from descentflow.effects import EFFECTS
        >>> found = explain(example_sides(EFFECTS["temperature"], [10.0]), EFFECTS)
        >>> found.verdict, list(found.named.groups), found.best.sizes["temperature"].round()
        ('effect', ['temperature'], array([10.]))
    """

    verdict: Verdict
    named: Named
    best: SetFit
    sets: Sequence[SetFit]
    shapes: Mapping[str, FlightsEffect]
    lacks: Sequence[Lack]
    known: Moments


def explain(compared: Compared, catalogue: Mapping[str, Effect], assumed: Assumptions | None = None) -> Explanation:
    """Explain how the real flights differ from the simulator's.

    Args:
        compared: Flights of both sides.
        catalogue: Effects that may be named.
        assumed: Constants; the usual ones if absent.
    """
    assumed = assumed or Assumptions()
    apart = set_apart(compared)
    aside, within = (compared.only(torch.nonzero(part)[:, 0]) for part in (apart, ~apart))
    known = moments(within, assumed)
    signatures = Signatures(within, known, assumed)
    by_flight = differing(catalogue)
    shapes = FlightShapes(within, known, by_flight, assumed).candidates(signatures) if by_flight else []
    means = [MeanEffect(effect, signatures, assumed) for effect in catalogue.values() if effect not in by_flight]
    candidates: list[Candidate] = [*(one for one in means if one.shows()), *shapes]
    groups = list({group.members: None for e in catalogue.values() if (group := e.scale_group) is not None})
    search = Search(known, candidates, assumed, exclusive=groups)
    sets = search.sets()
    named = name_effects(sets, assumed, alike=groups)
    best = next((one for one in sets if set(named.groups) <= set(one.names)), sets[0])
    verdict = verdict_of(named, best, known, search.fits)
    has_cause = verdict in ("effect", "partial")
    return Explanation(
        verdict,
        named,
        best,
        sets,
        {one.name: one for one in shapes},
        lacks(aside, assumed, has_cause=has_cause),
        known,
    )
