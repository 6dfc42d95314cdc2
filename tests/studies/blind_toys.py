"""A diagnosis that knows the key, to test the study with: never part of the product."""

from dataclasses import replace
from typing import Any

from studies.blind_diagnosis.blind_plan import FORMS, SCALE_GROUP, Plan, SetPlan
from studies.blind_diagnosis.outcome import nameable
from studies.blind_diagnosis.true_sizes import true_sizes


def perfect_report(plan: SetPlan, without: str | None = None) -> dict[str, Any]:
    """Report of a diagnosis without fault on a set."""
    named = [name for name in plan.causes if name != without and nameable(name, plan)]
    rest = len(named) < len(plan.causes)
    verdict = "none" if not plan.causes else "effect" if not rest else "partial" if named else "unknown"
    return {"verdict": verdict, "causes": [_cause(name, plan) for name in named]}


def _cause(name: str, plan: SetPlan) -> dict[str, Any]:
    return {
        "effect": name,
        "group": sorted(SCALE_GROUP - {name}) if name in SCALE_GROUP else [],
        "parameters": {
            key: {"estimate": value, "low": value - 1e-9, "high": value + 1e-9}
            for key, value in true_sizes(plan).get(name, {}).items()
        },
    }


def few_flights(plan: Plan) -> Plan:
    """The plan with sets of 15 flights: what each has got is drawn again wherever sizes are reported or scored."""
    return replace(plan, sets=tuple(replace(one, flights=15) for one in plan.sets))


def study(plan: Plan) -> tuple[dict[str, Any], dict[str, Any]]:
    """Manifest and perfect diagnoses of a plan, without flights."""
    jobs = []
    for one in plan.sets:
        jobs += [{"name": f"{one.name}_{form}", "set": one.name, "without": None, "form": form} for form in FORMS]
        if one.part == "withheld":
            jobs.append({**jobs[-1], "name": f"{one.name}_without", "without": next(iter(one.causes))})
    sets = {one.name: one for one in plan.sets}
    reports = {(job["set"], job["without"]): perfect_report(sets[job["set"]], job["without"]) for job in jobs}
    answers = {
        job["name"]: {"report": reports[job["set"], job["without"]], "refused": None, "cpu_s": 1.0} for job in jobs
    }
    return {"jobs": jobs}, answers
