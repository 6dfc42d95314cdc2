"""One diagnosis compared with what was injected."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import permutations
from typing import Any

from descentflow.effects import EFFECTS
from studies.blind_diagnosis.blind_flights import BASIC
from studies.blind_diagnosis.blind_plan import SCALE_GROUP, Kind, Plan, SetPlan
from studies.blind_diagnosis.blind_run import CHECKPOINT
from studies.blind_diagnosis.true_sizes import true_sizes

UNKNOWN, PARTIAL, NONE, REFUSED = "unknown", "partial", "none", "refused"


@dataclass(frozen=True)
class Outcome:
    """Injected and found effects of a set, and the judgement.

    Attributes:
        job: Name of the diagnosis.
        one: The set.
        wrong_polar: Whether its simulator had the wrong polar.
        by: How the simulator was given: by its ``checkpoint`` or by its ``flights``.
        without: Effect left out of the catalogue, if any.
        verdict: ``none``, ``effect``, ``partial``, ``unknown``, or ``refused`` where it raised a clear error.
        p_value: As reported.
        named: Effects named, in order, without those that only say that the polar is wrong where it is.
        groups: Of each, itself and what the diagnosis could not tell it from.
        right_first: The injected cause is named first (any of mass, idle thrust and drag stands for each of them where
            so marked: nothing that is observed tells them apart).
        in_group: The injected cause is in the group of the first.
        exact: Neither more nor fewer than the injected causes are named, and nothing is said to remain.
        report: The whole report.
        seconds: Processor time.

    Example:
        >>> one = SetPlan("blind_0000", "blind", "single", {"mass": {"factor": 0.9}}, 1.0, "all", 400, "simulator_0", 1)
        >>> outcome = Outcome(
        ...     "blind_0000", one, wrong_polar=False, by="checkpoint", without=None, verdict="effect", p_value=0.001,
        ...     named=("mass",), groups=(frozenset({"mass"}),), right_first=True, in_group=True, exact=True, report={},
        ...     seconds=9.0,
        ... )
        >>> outcome.first
        'mass'
    """

    job: str
    one: SetPlan
    wrong_polar: bool
    by: str
    without: str | None
    verdict: str
    p_value: float | None
    named: tuple[str, ...]
    groups: tuple[frozenset[str], ...]
    right_first: bool
    in_group: bool
    exact: bool
    report: Mapping[str, Any]
    seconds: float

    @property
    def kind(self) -> Kind:
        """Kind of the set, by the catalogue of today and not of the day when it was planned.

        Its one cause is to be named where the catalogue has it and the channels show it, or else called unknown.
        """
        if self.one.kind not in ("single", "outside"):
            return self.one.kind
        return "single" if all(nameable(cause, self.one) for cause in self.one.causes) else "outside"

    @property
    def first(self) -> str:
        """Column of the confusion matrix."""
        if self.verdict in (NONE, REFUSED):
            return self.verdict
        return self.named[0] if self.named and self.verdict != UNKNOWN else UNKNOWN

    @property
    def says_more(self) -> bool:
        """True if it reports something that no cause of the catalogue explains."""
        return self.verdict in (UNKNOWN, PARTIAL)


def outcomes(plan: Plan, manifest: Mapping[str, Any], diagnoses: Mapping[str, Any]) -> list[Outcome]:
    """Every diagnosis beside its key.

    Args:
        plan: The key.
        manifest: What was published.
        diagnoses: Sealed diagnoses by the name of their job.

    Returns:
        An outcome per diagnosis, sorted by job.

    Example:
        >>> one = SetPlan("blind_0000", "blind", "single", {"turn": {}}, 1.0, "all", 400, "simulator_000", 1)
        >>> job = {"name": "blind_0000", "set": "blind_0000", "without": None, "by": "checkpoint"}
        >>> diagnosis = {"report": {"verdict": "unknown", "p_value": 0.001, "causes": []}, "cpu_s": 9.0}
        >>> (found,) = outcomes(Plan(0, "00", (one,), ()), {"jobs": [job]}, {"blind_0000": diagnosis})
        >>> found.verdict, found.exact
        ('unknown', False)
    """
    sets = {one.name: one for one in plan.sets}
    wrong = {s.name for s in plan.simulators if s.polar}
    jobs = {job["name"]: job for job in manifest["jobs"]}
    return [_outcome(jobs[name], sets[jobs[name]["set"]], found, wrong) for name, found in sorted(diagnoses.items())]


def _outcome(job: Mapping[str, Any], one: SetPlan, found: Mapping[str, Any], wrong: set[str]) -> Outcome:
    report = found["report"] or {}
    wrong_polar = one.simulator in wrong
    causes = report.get("causes", [])
    if wrong_polar and not SCALE_GROUP & set(one.causes):
        # The polar is wrong too, and saying so is right.
        causes = [cause for cause in causes if cause["effect"] not in SCALE_GROUP]
    named = tuple(cause["effect"] for cause in causes)
    groups = tuple(frozenset({cause["effect"], *cause["group"]}) for cause in causes)
    injected = list(one.causes)
    first_group = groups[0] if groups else frozenset()
    single = injected[0] if len(injected) == 1 else None
    return Outcome(
        job=job["name"],
        one=one,
        wrong_polar=wrong_polar,
        by=job.get("by", CHECKPOINT),
        without=job["without"],
        verdict=report.get("verdict", REFUSED),
        p_value=report.get("p_value"),
        named=named,
        groups=groups,
        right_first=bool(named) and single is not None and stands_for(named[0], first_group, single),
        in_group=single in first_group,
        exact=matched(named, groups, injected) and report.get("verdict") != PARTIAL,
        report=report,
        seconds=float(found["cpu_s"]),
    )


def nameable(cause: str, one: SetPlan) -> bool:
    """Test for causes in the catalogue, in sets with the channels that they need.

    Args:
        cause: Its name.
        one: The set.

    Example:
        >>> from dataclasses import replace
        >>> rich = SetPlan("blind_0000", "blind", "single", {"turn": {}}, 1.0, "all", 400, "simulator_000", 1)
        >>> nameable("turn", rich), nameable("turn", replace(rich, channels="basic")), nameable("kept_thrust", rich)
        (True, False, False)
    """
    lacked = BASIC if one.channels == "basic" else ()
    return cause in EFFECTS and not set(EFFECTS[cause].needs) & set(lacked)


def stands_for(effect: str, group: frozenset[str], injected: str) -> bool:
    """Test for an effect that, with its group, is the injected one, up to what cannot be observed at all.

    Args:
        effect: Effect that was named.
        group: It and what the diagnosis could not tell it from.
        injected: Cause that was injected.

    Example:
        >>> stands_for("mass", frozenset({"mass", "drag_polar"}), "drag_polar")  # only their common scale is observed
        True
        >>> stands_for("temperature", frozenset({"temperature", "mass"}), "mass")
        False
    """
    return effect == injected or ({effect, injected} <= SCALE_GROUP and injected in group)


def matched(named: Sequence[str], groups: Sequence[frozenset[str]], injected: Sequence[str]) -> bool:
    """Test for named effects that are the injected ones, in any order.

    Args:
        named: Effects that were named.
        groups: Of each, it and what the diagnosis could not tell it from.
        injected: Causes that were injected.

    Example:
        >>> groups = [frozenset({"temperature"}), frozenset({"speed_brake"})]
        >>> matched(["temperature", "speed_brake"], groups, ["speed_brake", "temperature"])
        True
    """
    if len(named) != len(injected):
        return False
    return any(
        all(stands_for(effect, group, cause) for effect, group, cause in zip(named, groups, order, strict=True))
        for order in permutations(injected)
    )


def sizes(outcome: Outcome) -> list[dict[str, Any]]:
    """Estimates beside the truth, for every parameter of every cause that was named by its own name.

    Args:
        outcome: Of one diagnosis.

    Returns:
        Rows of ``job cause parameter unit true estimate low high covered``; none where no interval is claimed.

    Example:
        >>> one = SetPlan("blind_0000", "blind", "single", {"mass": {"factor": 0.9}}, 1.0, "all", 9, "simulator_0", 1)
        >>> size = {"estimate": -0.08, "low": -0.11, "high": -0.05, "unit": "1"}
        >>> cause = {"effect": "mass", "group": [], "parameters": {"relative_change": size}}
        >>> diagnosis = {"report": {"verdict": "effect", "causes": [cause]}, "cpu_s": 9.0}
        >>> job = {"name": "blind_0000", "set": "blind_0000", "without": None}
        >>> (found,) = outcomes(Plan(0, "00", (one,), ()), {"jobs": [job]}, {"blind_0000": diagnosis})
        >>> sizes(found)[0]["covered"]
        True
    """
    found = []
    causes = [c for c in outcome.report.get("causes", []) if c["effect"] in outcome.one.causes]
    truth = true_sizes(outcome.one) if causes else {}
    for cause in causes:
        for name, true in truth.get(cause["effect"], {}).items():
            estimate = cause["parameters"].get(name)
            if estimate is None or estimate["low"] is None or estimate["low"] == estimate["high"]:
                # It claims no interval.
                continue
            found.append(
                {
                    "job": outcome.job,
                    "cause": cause["effect"],
                    "parameter": name,
                    "unit": estimate["unit"],
                    "true": true,
                    "estimate": estimate["estimate"],
                    "low": estimate["low"],
                    "high": estimate["high"],
                    "covered": estimate["low"] <= true <= estimate["high"],
                }
            )
    return found


def overlap(low: float, high: float, other_low: float, other_high: float) -> float:
    """Intersection over union of two windows.

    Example:
        >>> overlap(200, 240, 210, 250)
        0.6
    """
    shared = max(0.0, min(high, other_high) - max(low, other_low))
    return shared / (max(high, other_high) - min(low, other_low))
