"""The scores of a study, once its key is open."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from studies.blind_diagnosis.binomial_share import share
from studies.blind_diagnosis.blind_plan import Plan
from studies.blind_diagnosis.blind_run import CHECKPOINT, FLIGHTS
from studies.blind_diagnosis.blind_worlds import WORLDS, StudyWorld
from studies.blind_diagnosis.goals import goals
from studies.blind_diagnosis.outcome import REFUSED, Outcome, outcomes
from studies.blind_diagnosis.score_tables import (
    CONFUSIONS,
    by_cause_table,
    claimed_closures,
    confusion_table,
    estimated_sizes,
    false_alarms,
    rates,
    refitted,
    strata,
    windows,
    withheld_effects,
)

SCHEMA_VERSION = 2


def score(
    plan: Plan,
    manifest: Mapping[str, Any],
    diagnoses: Mapping[str, Any],
    closings: Mapping[str, Any] | None = None,
) -> dict[str, Any]:
    """Score every sealed diagnosis.

    Args:
        plan: The key.
        manifest: What was published.
        diagnoses: Sealed diagnoses by job.
        closings: See :func:`studies.blind_diagnosis.closing.closing`, by set.

    Returns:
        Primitives for ``score.json``.

    Example:
        >>> from studies.blind_diagnosis.blind_draw import draw_plan
        >>> manifest = {"key_sha256": "00", "sealed_at": "today", "jobs": []}
        >>> score(draw_plan(20, seed=1), manifest, {})["diagnosed"]
        0
    """
    found = outcomes(plan, manifest, diagnoses)
    blind = [o for o in found if o.one.part == "blind" and o.by == CHECKPOINT]
    closed = closings or {}
    of_flights = [o for o in found if o.by == FLIGHTS]
    scored: dict[str, Any] = {
        "schema_version": SCHEMA_VERSION,
        "key_sha256": manifest["key_sha256"],
        "sealed_at": manifest["sealed_at"],
        "jobs": len(manifest["jobs"]),
        "diagnosed": len(found),
        "refused": [{"job": o.job, "error": diagnoses[o.job]["refused"]} for o in found if o.verdict == REFUSED],
        "seconds": _seconds(found),
        "slowest": _slowest(found),
        "worlds": {
            world.name: _world(
                world,
                [o for o in blind if o.one.world == world.name],
                [o for o in of_flights if o.one.world == world.name],
                closed,
            )
            for world in WORLDS
        },
        "same_verdicts": _same_verdicts(blind, of_flights),
        "withheld": withheld_effects([o for o in found if o.by == CHECKPOINT], closed),
        "refit": refitted(found),
    }
    return {**scored, "goals": goals(blind, scored)}


def _world(
    world: StudyWorld, blind: Sequence[Outcome], of_flights: Sequence[Outcome], closings: Mapping[str, Any]
) -> dict[str, Any]:
    """Scores of the blind sets of a world."""
    right = {o.one.name: o.one for o in of_flights if o.one.true is not None and (o.right_first or o.exact)}
    return {
        "sets": len(blind),
        "false_alarms": false_alarms(blind),
        "by_stratum": strata(blind),
        "confusion": {name: confusion_table(world, [o for o in blind if keep(o)]) for name, keep in CONFUSIONS.items()},
        "by_cause": by_cause_table(world, blind),
        "mixed": [_beside(o) for o in blind if o.kind == "mixed"],
        "wrong_polars": rates([o for o in blind if o.kind == "polar"]),
        "sizes": estimated_sizes(blind),
        "closure": claimed_closures(blind),
        "of_true": [
            {"set": name, "causes": list(one.causes), "size": one.size, **closings[name]}
            for name, one in sorted(right.items())
            if name in closings and one.part == "blind"
        ],
        "windows": windows(blind),
    }


def _beside(o: Outcome) -> dict[str, Any]:
    """A catalogued cause beside one that the catalogue does not have: named, and the rest said to be there?"""
    known, other = o.one.causes
    return {
        "job": o.job,
        "catalogued": known,
        "outside": other,
        "named": known in o.named,
        "rest": o.says_more or len(o.named) > 1,
        "verdict": o.verdict,
    }


def _same_verdicts(blind: Sequence[Outcome], of_flights: Sequence[Outcome]) -> dict[str, Any]:
    """Sets diagnosed by the checkpoint and by the flights of one simulator: whether verdict and causes are the same."""
    other = {o.one.name: o for o in of_flights}
    pairs = [(o, other[o.one.name]) for o in blind if o.one.name in other]
    same = [(a.verdict, set(a.named)) == (b.verdict, set(b.named)) for a, b in pairs]
    differing = [
        {"set": a.one.name, "checkpoint": [a.verdict, *a.named], "flights": [b.verdict, *b.named]}
        for (a, b), alike in zip(pairs, same, strict=True)
        if not alike
    ]
    return {**share(same), "differing": differing}


def _slowest(found: Sequence[Outcome]) -> list[dict[str, Any]]:
    """The five diagnoses that took longest, by processor time."""
    ordered = sorted(found, key=lambda o: -o.seconds)[:5]
    return [
        {"job": o.job, "causes": list(o.one.causes), "flights": o.one.flights, "seconds": o.seconds} for o in ordered
    ]


def _seconds(found: Sequence[Outcome]) -> dict[str, float | None]:
    by_size = {n: [o.seconds for o in found if o.one.flights == n] for n in sorted({o.one.flights for o in found})}
    return {str(n): float(np.median(values)) for n, values in by_size.items()}
