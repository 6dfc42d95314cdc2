"""One diagnosis compared with what was planted."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import permutations
from typing import Any

from descentflow.effects import EFFECTS
from studies.blind_diagnosis.blind_flights import BASIC
from studies.blind_diagnosis.blind_plan import BARE, Form, Kind, Plan, SetPlan

UNKNOWN, PARTIAL, NONE, REFUSED = "unknown", "partial", "none", "refused"


@dataclass(frozen=True)
class Outcome:
    """Planted and named causes of a set, and the judgement.

    Attributes:
        job: Name of the diagnosis.
        plan: The set.
        form: How the simulator was given.
        without: Effect left out of the catalogue, if any.
        verdict: ``none``, ``effect``, ``partial``, ``unknown``, or ``refused`` where it raised a clear error.
        groups: Of each cause that was named, in order, itself and what it cannot be distinguished from.
        planted: Causes that can be named: those that the catalogue has and the set's channels show.
        hidden: Causes that cannot.
        report: The whole report.
        seconds: Processor time.

    Example:
        >>> one = SetPlan("blind_0", "blind", "single", {"mass": {}}, 1.0, "all", 400, "simulator_0", 1, "own", "A320")
        >>> groups = (frozenset({"drag_polar", "mass"}),)
        >>> outcome = Outcome("blind_0", one, "bare", None, "effect", groups, ("mass",), (), {}, 9.0)
        >>> outcome.kind, outcome.right_first, outcome.exact, outcome.right, outcome.wrong
        ('single', True, True, True, False)
    """

    job: str
    one: SetPlan
    form: Form
    without: str | None
    verdict: str
    groups: tuple[frozenset[str], ...]
    planted: tuple[str, ...]
    hidden: tuple[str, ...]
    report: Mapping[str, Any]
    seconds: float

    @property
    def kind(self) -> Kind:
        """Kind of the set, by the catalogue of today and not of the day when it was planned."""
        counts: tuple[Kind, ...] = ("null", "single", "double", "triple")
        return "outside" if self.hidden else counts[len(self.planted)]

    @property
    def right_first(self) -> bool:
        """True if the group that is named first has a cause that was planted."""
        return bool(self.groups) and bool(self.groups[0] & set(self.planted))

    @property
    def exact(self) -> bool:
        """True if the causes are all named, each in a group, nothing else is, and nothing is reported to remain."""
        return not self.says_more and matched(self.groups, self.planted)

    @property
    def right(self) -> bool:
        """True if the answer is the truth: nothing of a null, unknown of what is outside, else all causes."""
        if self.kind == "null":
            return self.verdict == NONE
        return self.says_more if self.kind == "outside" else self.exact

    @property
    def wrong(self) -> bool:
        """True if something is named that was not planted."""
        return any(not group & set(self.planted) for group in self.groups)

    @property
    def says_more(self) -> bool:
        """True if it reports something that no cause of the catalogue explains."""
        return self.verdict in (UNKNOWN, PARTIAL)


def outcomes(
    plan: Plan, manifest: Mapping[str, Any], diagnoses: Mapping[str, Any], *, prefix: str = ""
) -> list[Outcome]:
    """Every diagnosis next to its key.

    Args:
        plan: The key.
        manifest: What was published.
        diagnoses: Sealed diagnoses by the name of their job.
        prefix: Of the names of jobs, where several studies are scored as one.

    Returns:
        An outcome per diagnosis, sorted by job.

    Example:
        >>> one = SetPlan("blind_0", "blind", "single", {"turn": {}}, 1.0, "all", 400, "simulator_0", 1, "own", "A320")
        >>> job = {"name": "blind_0_bare", "set": "blind_0", "without": None, "form": "bare"}
        >>> diagnosis = {"report": {"verdict": "unknown", "causes": []}, "cpu_s": 9.0}
        >>> (found,) = outcomes(Plan(0, "00", (one,), ()), {"jobs": [job]}, {"blind_0_bare": diagnosis})
        >>> found.verdict, found.exact
        ('unknown', False)
    """
    sets = {drawn.name: drawn for drawn in plan.sets}
    jobs = {job["name"]: job for job in manifest["jobs"]}
    return [
        replace(_outcome(jobs[name], sets[jobs[name]["set"]], diagnosis), job=f"{prefix}{name}")
        for name, diagnosis in sorted(diagnoses.items())
    ]


def _outcome(job: Mapping[str, Any], plan: SetPlan, answer: Mapping[str, Any]) -> Outcome:
    report = answer["report"] or {}
    form: Form = job["form"]
    shown = [name for name in plan.causes if nameable(name, plan) and name != job["without"]]
    lacks = {lack["quantity"] for lack in report.get("details", {}).get("lacks", [])}
    # A simulator without any level flight lacks it, which is listed apart from the causes.
    planted = [name for name in shown if not (name == "level_off" and form in BARE and "level" in lacks)]
    return Outcome(
        job=job["name"],
        one=plan,
        form=form,
        without=job["without"],
        verdict=report.get("verdict", REFUSED),
        groups=tuple(frozenset({cause["effect"], *cause["group"]}) for cause in report.get("causes", [])),
        planted=tuple(planted),
        hidden=tuple(name for name in plan.causes if name not in shown),
        report=report,
        seconds=float(answer["cpu_s"]),
    )


def nameable(cause: str, plan: SetPlan) -> bool:
    """Test for causes in the catalogue, in sets with the channels that they need.

    Args:
        cause: Its name.
        plan: The set.

    Example:
        >>> from dataclasses import replace
        >>> rich = SetPlan("blind_0", "blind", "single", {"turn": {}}, 1.0, "all", 400, "simulator_0", 1, "own", "A320")
        >>> nameable("turn", rich), nameable("turn", replace(rich, channels="basic")), nameable("kept_thrust", rich)
        (True, False, False)
    """
    lacked = BASIC if plan.channels == "basic" else ()
    return cause in EFFECTS and not set(EFFECTS[cause].needs) & set(lacked)


def matched(groups: Sequence[frozenset[str]], planted: Sequence[str]) -> bool:
    """Test for groups that stand for the planted causes one to one, in any order.

    Args:
        groups: Of each named cause, it and what it cannot be distinguished from.
        planted: Causes that were planted.

    Example:
        >>> matched([frozenset({"drag_polar", "mass"}), frozenset({"speed_brake"})], ["speed_brake", "mass"])
        True
    """
    return len(groups) == len(planted) and any(
        all(cause in group for group, cause in zip(groups, order, strict=True)) for order in permutations(planted)
    )


def sizes(outcome: Outcome, truth: Mapping[str, Mapping[str, float]]) -> list[dict[str, Any]]:
    """Estimates next to the truth, for every parameter of every cause that was named by its own name.

    Args:
        outcome: Of one diagnosis.
        truth: Of its set, see :func:`~studies.blind_diagnosis.true_sizes.true_sizes`.

    Returns:
        Rows of ``job cause parameter true estimate low high covered``; none where no interval is claimed.

    Example:
        >>> causes = {"mass": {"factor": 0.9}}
        >>> one = SetPlan("blind_0", "blind", "single", causes, 1.0, "all", 9, "simulator_0", 1, "own", "A320")
        >>> size = {"estimate": -0.08, "low": -0.11, "high": -0.05, "unit": "1"}
        >>> cause = {"effect": "mass", "group": [], "parameters": {"relative_change": size}}
        >>> diagnosis = {"report": {"verdict": "effect", "causes": [cause]}, "cpu_s": 9.0}
        >>> job = {"name": "blind_0_bare", "set": "blind_0", "without": None, "form": "bare"}
        >>> (found,) = outcomes(Plan(0, "00", (one,), ()), {"jobs": [job]}, {"blind_0_bare": diagnosis})
        >>> from studies.blind_diagnosis.true_sizes import true_sizes
        >>> sizes(found, true_sizes(one))[0]["covered"]
        True
    """
    rows = []
    causes = [c for c in outcome.report.get("causes", []) if c["effect"] in outcome.one.causes]
    for cause in causes:
        for name, true in truth.get(cause["effect"], {}).items():
            estimate = cause["parameters"].get(name)
            if estimate is None or estimate["low"] is None or estimate["low"] == estimate["high"]:
                # It claims no interval.
                continue
            ends = {key: estimate[key] for key in ("estimate", "low", "high")}
            covered = estimate["low"] <= true <= estimate["high"]
            row = {"job": outcome.job, "cause": cause["effect"], "parameter": name, "true": true, "covered": covered}
            rows.append(row | ends)
    return rows
