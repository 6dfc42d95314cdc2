"""The scores of a study: a perfect diagnosis reaches every goal, and every kind of fault is seen."""

import copy
import json
from typing import Any

import numpy as np
import pytest
from blind_toys import study

from descentflow.core.errors import ConfigError
from descentflow.simulation.causes import CATALOGUED, CAUSES
from descentflow.studies.blind_diagnosis.blind_page import blind_page
from descentflow.studies.blind_diagnosis.blind_plan import HOLDING, SCALE_GROUP, Plan, draw_plan
from descentflow.studies.blind_diagnosis.blind_score import score
from descentflow.studies.blind_diagnosis.outcome import matched, overlap, stands_for
from descentflow.studies.blind_diagnosis.true_sizes import reported

NAMES = tuple(cause.name for cause in CATALOGUED)
PLAN = draw_plan(300, seed=7)
MANIFEST, PERFECT = study(PLAN, NAMES)
CLOSED = {f"withheld_{name}": {"before": 0.6, "after": 0.1, "true": 0.1, "of_true": 1.0} for name in NAMES}
SETS = {one.name: one for one in PLAN.sets}


def uniform(found: dict[str, Any]) -> dict[str, Any]:
    """The diagnoses with p-values of null sets as chance gives them."""
    found = copy.deepcopy(found)
    null = [name for name, one in SETS.items() if one.kind == "null"]
    for name, p in zip(null, np.linspace(0.01, 0.99, len(null)), strict=True):
        found[name]["report"]["p_value"] = float(p)
    return found


def reached(found: dict[str, Any]) -> dict[str, dict[str, Any]]:
    return {goal["goal"]: goal for goal in score(PLAN, MANIFEST, found, CLOSED)["goals"]}


def test_a_plan_is_made_up_as_asked() -> None:
    blind = [one for one in PLAN.sets if one.part == "blind"]
    kinds = {kind: sum(one.kind == kind for one in blind) for kind in ("null", "single", "double", "outside")}
    assert kinds == {"null": 75, "single": 138, "double": 42, "outside": 45}
    singles = [next(iter(one.causes)) for one in blind if one.kind == "single"]
    assert min(singles.count(name) for name in NAMES) >= 10
    for one in blind:
        assert len(one.causes) == {"null": 0, "single": 1, "double": 2, "outside": 1}[one.kind]
        assert not any(len(set(one.causes) & group) > 1 for group in (SCALE_GROUP, HOLDING))
        assert one.kind != "null" or one.size == 0
    seed_of = {simulator.name: simulator.seed for simulator in PLAN.simulators}
    paired = [one for one in PLAN.sets if one.part == "withheld"]
    seeds = [one.seed for one in PLAN.sets] + [seed for name, seed in seed_of.items() if not name.startswith("refit")]
    assert len(set(seeds)) == len(seeds)
    # The one that knows the effect has the aircraft and crews of the one that is corrected.
    assert all(seed_of[one.simulator] == seed_of[one.name.replace("withheld", "refit")] for one in paired)
    assert len(paired) == 13
    # No null set against a wrong polar: there would be a gap.
    wrong = {simulator.name for simulator in PLAN.simulators if simulator.cd0_factor != 1}
    assert not any(one.kind == "null" and one.simulator in wrong for one in blind)
    assert any(one.simulator in wrong for one in blind)
    # The order tells nothing of the kind, and the key is its own inverse.
    assert {one.kind for one in blind[:40]} == {"null", "single", "double", "outside"}
    assert Plan.from_dict(json.loads(json.dumps(PLAN.as_dict()))) == PLAN
    assert draw_plan(300, seed=8).nonce != PLAN.nonce
    with pytest.raises(ConfigError, match="0 sets"):
        draw_plan(0, seed=1)


def test_a_perfect_diagnosis_meets_every_goal() -> None:
    missed = [name for name, goal in reached(uniform(PERFECT)).items() if not goal["met"]]
    # Its intervals are right every time, which is too often.
    assert missed == ["90 % intervals cover 85 to 95 %"]


def test_faults_are_seen_where_they_are() -> None:
    found = uniform(PERFECT)
    for name, one in SETS.items():
        report = found[name]["report"]
        if one.kind == "null" or one.kind == "outside":
            report |= {"verdict": "effect", "causes": PERFECT["withheld_temperature"]["report"]["causes"]}
        elif one.kind == "single":
            report |= {"verdict": "unknown", "causes": []}
        elif one.kind == "double":
            report["causes"] = report["causes"][:1]
    goals = reached(found)
    missed = {name for name, goal in goals.items() if not goal["met"]}
    assert goals["false alarms at most 5 %"]["reached"] == 1
    assert goals["right effect first, all channels, at least 95 %"]["reached"] == 0
    assert goals["outside the catalogue called unknown, at least 90 %"]["reached"] == 0
    assert goals["catalogued effects wrongly called unknown, at most 5 %"]["reached"] == 1
    assert goals["two effects at once, exact set, all channels, at least 85 %"]["reached"] == 0
    assert "put back: found" in missed
    table = score(PLAN, MANIFEST, found)["confusion"]["all channels"]
    outside = np.array(table["table"])[-3:]
    assert outside[:, table["columns"].index("temperature")].sum() == outside.sum()


def test_p_values_that_pile_up_are_seen() -> None:
    assert not reached(PERFECT)["p-values of null sets uniform (p of the KS test above 0.05)"]["met"]


def test_a_refusal_counts_as_a_failure() -> None:
    found = copy.deepcopy(PERFECT)
    name = next(name for name, one in SETS.items() if one.kind == "single" and one.channels == "all" and one.size > 0.7)
    found[name] |= {"report": None, "refused": "DataError: no common levels"}
    scored = score(PLAN, MANIFEST, found)
    assert scored["refused"] == [{"job": name, "error": "DataError: no common levels"}]
    assert sum(np.array(c["table"])[:, -1].sum() for c in scored["confusion"].values()) == 1


def test_right_is_right_up_to_the_gauge_only() -> None:
    assert stands_for("mass", frozenset({"mass", "drag_polar"}), "drag_polar")
    assert not stands_for("mass", frozenset({"mass"}), "drag_polar")
    assert not stands_for("temperature", frozenset({"temperature", "mass"}), "mass")
    groups = (frozenset({"temperature"}), frozenset({"mass", "idle_thrust"}))
    assert matched(("temperature", "mass"), groups, ["idle_thrust", "temperature"])
    assert not matched(("temperature",), groups[:1], ["idle_thrust", "temperature"])
    assert overlap(200, 240, 210, 250) == 0.6
    assert overlap(200, 210, 220, 250) == 0


def test_truth_is_in_the_units_of_the_report() -> None:
    assert reported("mass", {"factor": 0.9}) == {"relative_change": pytest.approx(-0.1)}
    # 2 kt in 1,000 ft: 1.0289 m/s in 304.8 m.
    wind = reported("wind_gradient", {"slope_kt_per_kft": 2.0, "spread_kt_per_kft": 0.7})
    assert wind == {"slope_per_s": pytest.approx(1.028888 / 304.8, rel=1e-6)}
    bias = reported("airspeed_bias", {"bias_kt": 2.0, "slope_kt_per_mach": 25.0})
    assert bias == {"bias_kt": pytest.approx(3.25), "growth_kt": pytest.approx(2.5)}
    assert reported("level_off", {"share": 0.6, "duration_s": 90.0}) == {}
    for name in NAMES:
        reported(name, CAUSES[name].draw(np.random.default_rng(0), 1.0))


def test_the_page_shows_everything_and_needs_nothing() -> None:
    scored = score(PLAN, MANIFEST, uniform(PERFECT), CLOSED)
    text = blind_page(json.loads(json.dumps(scored, allow_nan=False))).render()
    assert text.count("<img") == 6
    assert "http" not in text.replace("data:image", "")
    assert all(goal["goal"] in text for goal in scored["goals"])


def test_a_study_of_one_set_is_scored() -> None:
    alone = draw_plan(1, seed=1, extra=False, n_simulators=1)
    goals = score(alone, *study(alone, NAMES))["goals"]
    assert {goal["met"] for goal in goals} >= {None}
