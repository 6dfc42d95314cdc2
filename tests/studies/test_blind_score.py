"""The scores of a study: a perfect diagnosis reaches every goal, and every kind of fault is seen."""

import copy
import json
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from blind_toys import few_flights, study

from descentflow.core.errors import ConfigError
from descentflow.simulation.cause_values import completed
from descentflow.simulation.causes import CAUSES
from descentflow.simulation.plantable import PLANTABLE
from studies.blind_diagnosis.blind_draw import draw_plan
from studies.blind_diagnosis.blind_plan import HOLDING, SCALE_GROUP, Plan, SetPlan
from studies.blind_diagnosis.blind_worlds import OWN
from studies.blind_diagnosis.drawn_causes import CATALOGUED, DRAWN
from studies.blind_diagnosis.outcome import matched, nameable, outcomes
from studies.blind_diagnosis.study_score import GOALS, score, table
from studies.blind_diagnosis.true_sizes import true_sizes

WHOLE = draw_plan(300, seed=7, n_foreign=120)
PLAN = few_flights(draw_plan(60, seed=7, n_foreign=40))
MANIFEST, PERFECT = study(PLAN)
SETS = {one.name: one for one in PLAN.sets}


def reached(found: dict[str, Any], **closures: dict[str, Any]) -> dict[tuple[str, str], dict[str, Any]]:
    scored = score(outcomes(PLAN, MANIFEST, found), closures)
    return {(row["column"], row["goal"]): row for row in scored["rows"]}


def test_a_plan_is_made_up_as_asked() -> None:
    blind = [one for one in WHOLE.sets if one.part == "blind"]
    own, foreign = ([one for one in blind if one.world == world] for world in ("own", "foreign"))
    kinds = {kind: sum(one.kind == kind for one in own) for kind in ("null", "single", "double", "triple", "outside")}
    assert kinds == {"null": 72, "single": 105, "double": 66, "triple": 15, "outside": 42}
    assert (len(own), len(foreign)) == (300, 120)
    singles = [next(iter(one.causes)) for one in own if one.kind == "single"]
    assert min(singles.count(name) for name in OWN.catalogued) >= 7
    for one in blind:
        assert len(one.causes) == {"null": 0, "single": 1, "double": 2, "triple": 3, "outside": 1}[one.kind]
        assert not any(len(set(one.causes) & group) > 1 for group in (SCALE_GROUP, HOLDING))
        assert (one.size == 0) == (not one.causes)
    # Two causes have sizes of every ratio.
    assert {one.full for one in own if one.kind == "double"} == {True, False}
    assert all("spread_fl" in one.causes["speed_brake"] for one in foreign if "speed_brake" in one.causes)
    assert not any(one.model == "global5000" for one in foreign if "wave_drag" in one.causes)
    simulators = {simulator.name: simulator for simulator in WHOLE.simulators}
    seeds = [one.seed for one in (*WHOLE.sets, *WHOLE.simulators)]
    assert len(set(seeds)) == len(seeds)
    for one in WHOLE.sets:
        held = simulators[one.simulator]
        assert (held.world, held.model) == (one.world, one.model)
    # Which corrected flights are kept does not depend on what is planted.
    assert {one.kind for one in blind if one.closure} == {one.kind for one in blind}
    null = [one.simulator for one in own if one.kind == "null"]
    assert len(set(null)) == len(null)
    assert {one.kind for one in blind[:60]} == {"null", "single", "double", "triple", "outside"}
    assert Plan.from_dict(json.loads(json.dumps(WHOLE.as_dict()))) == WHOLE
    assert draw_plan(300, seed=8).nonce != WHOLE.nonce
    with pytest.raises(ConfigError, match="0 sets"):
        draw_plan(0, seed=1)


def test_a_perfect_diagnosis_meets_every_goal() -> None:
    rows = reached(PERFECT)
    assert [key for key, row in rows.items() if row["met"] is False] == []
    judged = {key for key, row in rows.items() if row["met"]}
    assert judged == {(column, goal.text) for goal in GOALS for column in goal.asked}
    assert rows["own", GOALS[1].text]["low"] < 1


def test_faults_are_seen_where_they_are() -> None:
    found = copy.deepcopy(PERFECT)
    warm = PERFECT["withheld_temperature_flights"]["report"]["causes"]
    for outcome in outcomes(PLAN, MANIFEST, PERFECT):
        report = found[outcome.job]["report"]
        if outcome.one.part == "withheld":
            continue
        if outcome.kind in ("null", "outside"):
            found[outcome.job]["report"] = {"verdict": "effect", "causes": warm}
        elif outcome.kind == "single":
            found[outcome.job]["report"] = {"verdict": "unknown", "causes": []}
        else:
            found[outcome.job]["report"] = {**report, "causes": report["causes"][:1]}
    rows = reached(found)
    for column in ("own", "foreign", "bare"):
        alarms = rows[column, "false alarms"]
        assert (alarms["share"], alarms["met"]) == (1, False)
        assert len(alarms["misses"]) == alarms["n"]
        for text in ("right effect or group first, full size", "both of two, nothing else"):
            assert (rows[column, text]["share"], rows[column, text]["met"]) == (0, False)
        assert rows[column, "outside the catalogue: unknown"]["share"] == 0
        assert 0 < rows[column, "one or two catalogued causes, wrongly unknown"]["share"] < 1
        assert rows[column, "a wrong name, of all"]["met"] is False
    alarms = next(line for line in table(score(outcomes(PLAN, MANIFEST, found), {})).splitlines() if "alarms" in line)
    assert alarms.count("100.0%") == alarms.count("**missed**") == 3


def test_a_verdict_that_something_remains_is_no_right_answer_for_two_effects() -> None:
    found = copy.deepcopy(PERFECT)
    for outcome in outcomes(PLAN, MANIFEST, PERFECT):
        if outcome.kind == "double":
            found[outcome.job]["report"]["verdict"] = "partial"
    assert reached(found)["own", "both of two, nothing else"]["share"] == 0


def test_intervals_are_judged_parameter_by_parameter() -> None:
    found = copy.deepcopy(PERFECT)
    warm = [o for o in outcomes(PLAN, MANIFEST, PERFECT) if "temperature" in o.one.causes and o.one.part == "blind"]
    for k, outcome in enumerate(warm):
        for cause in found[outcome.job]["report"]["causes"]:
            if cause["effect"] == "temperature" and k % 10 == 0:
                found[outcome.job]["report"] = copy.deepcopy(found[outcome.job]["report"])
                for mine in found[outcome.job]["report"]["causes"]:
                    if mine["effect"] == "temperature":
                        mine["parameters"]["deviation_k"]["low"] += 1.0
    rows = {(row["column"], row["parameter"]): row for row in score(outcomes(PLAN, MANIFEST, found), {})["intervals"]}
    bare = rows["bare", "deviation_k"]
    assert 0.8 < bare["share"] < 1
    assert bare["met"] == (0.85 <= bare["share"] <= 0.95)
    assert rows["own", "slope_per_s"]["share"] == 1


def test_closures_are_judged_by_column() -> None:
    jobs = [f"{one.name}_{form}" for one in PLAN.sets if one.closure for form in ("flights", "bare")]
    near = {job: {"reported": 0.9, "measured": 0.78, "error": None} for job in jobs}
    rows = reached(PERFECT, **near)
    assert rows["own", "closure within 0.1 of that measured on fresh flights"]["met"] is False
    assert rows["bare", "closure within 0.15 of that measured on fresh flights"]["met"] is True


def test_groups_stand_for_causes_one_to_one() -> None:
    scale, brakes = frozenset(SCALE_GROUP), frozenset({"speed_brake"})
    assert matched([scale, brakes], ["speed_brake", "mass"])
    assert not matched([scale], ["speed_brake", "mass"])
    assert not matched([scale, scale], ["speed_brake", "mass"])
    assert matched([], [])


def single(cause: str, values: dict[str, float], **more: Any) -> SetPlan:
    where = {"world": "own", "model": "A320", **more}
    return SetPlan("blind_0000", "blind", "single", {cause: values}, 1.0, "all", 300, "simulator_000", 3, **where)


def test_a_turn_is_asked_for_where_headings_are_there() -> None:
    """Whatever the plan called it: one of before turns were in the catalogue counts them as outside."""
    one = replace(single("turn", {}), kind="outside")
    sets = (one, replace(one, name="blind_0001", channels="basic"))
    jobs = [{"name": s.name, "set": s.name, "without": None, "form": "flights"} for s in sets]
    named = {"report": {"verdict": "effect", "causes": [{"effect": "turn", "group": []}]}, "cpu_s": 9.0}
    rich, poor = outcomes(Plan(0, "00", sets, ()), {"jobs": jobs}, {s.name: named for s in sets})
    assert (rich.kind, rich.right_first, rich.wrong) == ("single", True, False)
    assert (poor.kind, poor.wrong, nameable("turn", poor.one)) == ("outside", True, False)


def test_a_simulator_without_level_flight_lacks_it() -> None:
    """It is listed apart from the causes, and that is the right answer."""
    one = single("level_off", {"share": 0.6})
    jobs = [{"name": form, "set": one.name, "without": None, "form": form} for form in ("flights", "bare")]
    report = {"verdict": "none", "causes": [], "details": {"lacks": [{"quantity": "level"}]}}
    found = outcomes(
        Plan(0, "00", (one,), ()), {"jobs": jobs}, {j["name"]: {"report": report, "cpu_s": 1} for j in jobs}
    )
    assert {o.form: (o.kind, o.exact) for o in found} == {"bare": ("null", True), "flights": ("single", False)}


def test_truth_is_what_the_flights_have_got() -> None:
    """Means over the flights of the set, drawn again from its seed."""
    braked = true_sizes(single("speed_brake", {"factor": 1.5, "share": 0.5, "low_fl": 200, "high_fl": 250}))
    assert braked["speed_brake"]["share"] == pytest.approx(0.5, abs=0.1)
    assert braked["speed_brake"]["low_fl"] == pytest.approx(200)
    warm = true_sizes(single("temperature", {"deviation_k": 5.0, "spread_k": 3.0}))["temperature"]["deviation_k"]
    assert 0 < abs(warm - 5) < 4 * 3 / 300**0.5
    for name in OWN.catalogued:
        true_sizes(single(name, DRAWN[name][0](np.random.default_rng(0), 1.0)))


def test_truth_of_foreign_flights_is_what_is_flown() -> None:
    """Ten kelvins at every geometric height leave some 8 K at a pressure altitude; drag has another aircraft's base."""
    foreign = {"world": "foreign", "model": "MD11"}
    warm = true_sizes(single("temperature", {"deviation_k": 10.0}, **foreign))["temperature"]
    # Mean of the standard temperature from FL150 to FL350, 238.6 K, over 288.15 K.
    assert warm["deviation_k"] == pytest.approx(10 * 238.6 / 288.15, rel=1e-3)
    brakes = true_sizes(single("speed_brake", {"factor": 1.5, "spread_fl": 10.0}, **foreign))["speed_brake"]
    assert set(brakes) == {"low_fl", "high_fl", "share"}
    assert brakes["low_fl"] == pytest.approx(230, abs=4)
    assert true_sizes(single("drag_polar", {"factor": 1.1}, **foreign)) == {}
    heavy = true_sizes(single("mass", {"factor": 1.1, "share": 0.5}, **foreign))["mass"]
    assert heavy["relative_change"] == pytest.approx(0.05, abs=0.012)


def test_a_study_of_one_set_is_scored() -> None:
    alone = few_flights(draw_plan(1, seed=1, withheld=False))
    manifest, found = study(alone)
    assert "| false alarms |" in table(score(outcomes(alone, manifest, found), {}))


def test_every_cause_draws_values_that_can_be_planted() -> None:
    assert len(CATALOGUED) == 14
    assert set(DRAWN) == set(CAUSES)
    for name, (draw, differ) in DRAWN.items():
        for seed in range(20):
            generator = np.random.default_rng(seed)
            for size in (0.4, 1.15):
                values = draw(generator, size) | (differ(generator, size) if differ else {})
                assert completed(name, PLANTABLE, values).items() >= values.items()
