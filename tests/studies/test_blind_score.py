"""The scores of a study: a perfect diagnosis reaches every goal, and every kind of fault is seen."""

import copy
from typing import Any

import numpy as np
import pytest
from blind_toys import few_flights, study

from studies.blind_diagnosis.blind_draw import draw_plan
from studies.blind_diagnosis.blind_plan import SetPlan
from studies.blind_diagnosis.blind_worlds import OWN
from studies.blind_diagnosis.drawn_causes import DRAWN
from studies.blind_diagnosis.outcome import outcomes
from studies.blind_diagnosis.study_score import GOALS, score, table
from studies.blind_diagnosis.true_sizes import true_sizes

PLAN = few_flights(draw_plan(60, seed=7, n_foreign=40))
MANIFEST, PERFECT = study(PLAN)


def reached(answers: dict[str, Any], **closures: dict[str, Any]) -> dict[tuple[str, str], dict[str, Any]]:
    scored = score(outcomes(PLAN, MANIFEST, answers), closures)
    return {(row["column"], row["goal"]): row for row in scored["rows"]}


def test_a_perfect_diagnosis_meets_every_goal() -> None:
    rows = reached(PERFECT)
    assert [key for key, row in rows.items() if row["met"] is False] == []
    judged = {key for key, row in rows.items() if row["met"]}
    assert judged == {(column, goal.text) for goal in GOALS for column in goal.asked}
    assert rows["own", GOALS[1].text]["low"] < 1


def test_faults_are_seen_where_they_are() -> None:
    changed = copy.deepcopy(PERFECT)
    warm = PERFECT["withheld_temperature_flights"]["report"]["causes"]
    for outcome in outcomes(PLAN, MANIFEST, PERFECT):
        report = changed[outcome.job]["report"]
        if outcome.one.part == "withheld":
            continue
        if outcome.kind in ("null", "outside"):
            changed[outcome.job]["report"] = {"verdict": "effect", "causes": warm}
        elif outcome.kind == "single":
            changed[outcome.job]["report"] = {"verdict": "unknown", "causes": []}
        else:
            changed[outcome.job]["report"] = {**report, "causes": report["causes"][:1]}
    rows = reached(changed)
    for column in ("own", "foreign", "bare"):
        alarms = rows[column, "false alarms"]
        assert (alarms["share"], alarms["met"]) == (1, False)
        assert len(alarms["misses"]) == alarms["n"]
        for text in ("right effect or group first, full size", "both of two, nothing else"):
            assert (rows[column, text]["share"], rows[column, text]["met"]) == (0, False)
        assert rows[column, "outside the catalogue: unknown"]["share"] == 0
        assert 0 < rows[column, "one or two catalogued causes, wrongly unknown"]["share"] < 1
        assert rows[column, "a wrong name, of all"]["met"] is False
    alarms = next(line for line in table(score(outcomes(PLAN, MANIFEST, changed), {})).splitlines() if "alarms" in line)
    assert alarms.count("100.0%") == alarms.count("**missed**") == 3


def test_intervals_are_judged_parameter_by_parameter() -> None:
    changed = copy.deepcopy(PERFECT)
    warm = [o for o in outcomes(PLAN, MANIFEST, PERFECT) if "temperature" in o.one.causes and o.one.part == "blind"]
    for k, outcome in enumerate(warm):
        for cause in changed[outcome.job]["report"]["causes"]:
            if cause["effect"] == "temperature" and k % 10 == 0:
                changed[outcome.job]["report"] = copy.deepcopy(changed[outcome.job]["report"])
                for mine in changed[outcome.job]["report"]["causes"]:
                    if mine["effect"] == "temperature":
                        mine["parameters"]["deviation_k"]["low"] += 1.0
    rows = {(row["column"], row["parameter"]): row for row in score(outcomes(PLAN, MANIFEST, changed), {})["intervals"]}
    bare = rows["bare", "deviation_k"]
    assert 0.8 < bare["share"] < 1
    assert bare["met"] == (0.85 <= bare["share"] <= 0.95)
    assert rows["own", "slope_per_s"]["share"] == 1


def single(cause: str, values: dict[str, float], **more: Any) -> SetPlan:
    where = {"world": "own", "model": "A320", **more}
    return SetPlan("blind_0000", "blind", "single", {cause: values}, 1.0, "all", 300, "simulator_000", 3, **where)


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
