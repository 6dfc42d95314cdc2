"""A diagnosis that knows the key, to test the study with: never part of the product."""

from dataclasses import replace
from typing import Any

from studies.blind_diagnosis.blind_plan import SCALE_GROUP, Plan, SetPlan
from studies.blind_diagnosis.outcome import nameable
from studies.blind_diagnosis.true_sizes import true_sizes


def perfect_report(one: SetPlan, catalogued: tuple[str, ...], without: str | None = None) -> dict[str, Any]:
    """Report of a diagnosis without fault on a set."""
    named = [name for name in one.causes if name in catalogued and name != without and nameable(name, one)]
    rest = len(named) < len(one.causes)
    verdict = "none" if not one.causes else "effect" if not rest else "partial" if named else "unknown"
    causes = [_cause(name, one) for name in named]
    return {
        "verdict": verdict,
        "p_value": 0.5 if verdict == "none" else 0.001,
        "floor": 0.05,
        "gap_before": 0.05 if verdict == "none" else 0.6,
        "gap_after": 0.05,
        "where": [{"quantity": "rate", "level_low_fl": 200, "level_high_fl": 240, "distance": 0.3, "unit": "sd"}],
        "causes": causes,
    }


def _cause(name: str, one: SetPlan) -> dict[str, Any]:
    sizes = true_sizes(one).get(name, {})
    closures = {kind: {"estimate": 0.95, "low": 0.9, "high": 1.0} for kind in ("marginal", "conditional", "transfer")}
    return {
        "effect": name,
        "group": sorted(SCALE_GROUP - {name}) if name in SCALE_GROUP else [],
        "probability": 0.99,
        "parameters": {
            key: {"estimate": value, "low": value - 1e-9, "high": value + 1e-9, "unit": "1"}
            for key, value in sizes.items()
        },
        "closure": closures,
        "rivals": {"drag_polar": {"closure": 0.5}},
    }


def few_flights(plan: Plan) -> Plan:
    """The plan with sets of 15 flights: what each has got is drawn again wherever sizes are reported or scored."""
    return replace(plan, sets=tuple(replace(one, flights=15) for one in plan.sets))


def study(plan: Plan, catalogued: tuple[str, ...]) -> tuple[dict[str, Any], dict[str, Any]]:
    """Manifest and perfect diagnoses of a plan, without flights."""
    jobs = []
    for one in plan.sets:
        job = {"name": one.name, "set": one.name, "simulator": one.simulator, "without": None, "by": "checkpoint"}
        jobs.append(job)
        if one.part != "refit":
            jobs.append({**job, "name": f"{one.name}_flights", "by": "flights"})
        if one.part == "withheld":
            jobs.append({**job, "name": f"{one.name}_without", "without": next(iter(one.causes))})
    sets = {one.name: one for one in plan.sets}
    found = {
        job["name"]: {
            "report": perfect_report(sets[job["set"]], catalogued, job["without"]),
            "refused": None,
            "cpu_s": 1.0,
        }
        for job in jobs
    }
    return {"jobs": jobs, "key_sha256": "0" * 64, "sealed_at": "2024-01-01T00:00:00Z"}, found
