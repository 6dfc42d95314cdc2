"""The scores of a study, once its key is open: goals next to what was reached, and every miss by name."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Final, Literal

from scipy import stats

from studies.blind_diagnosis.blind_plan import BARE
from studies.blind_diagnosis.outcome import NONE, REFUSED, UNKNOWN, Outcome, sizes
from studies.blind_diagnosis.true_sizes import true_sizes

Column = Literal["own", "foreign", "bare"]
COLUMNS: Final[tuple[Column, ...]] = ("own", "foreign", "bare")
"""Simulators of our world and of JSBSim's aircraft that have weather and noise; those of both that have not."""
FEWEST_ESTIMATES: Final = 20
"""Intervals of a parameter below which its coverage is not judged: of 20 that are right, 17 to 19 cover."""
COVERAGE: Final = (0.85, 0.95)
"""Goal for the share of truths that a 90 % interval holds."""
WITHIN: Final[Mapping[Column, float]] = {"own": 0.1, "foreign": 0.15, "bare": 0.15}
"""Difference of reported and measured closure that is near enough."""
Test = Callable[[Outcome], bool]


@dataclass(frozen=True)
class Goal:
    """A share of some outcomes that is to be small or large.

    Example:
        >>> Goal("false alarms", lambda o: o.kind == "null", lambda o: o.verdict != "none", {"own": 0.04}).at_least
        False
    """

    text: str
    of: Test
    counted: Test
    asked: Mapping[Column, float] = field(default_factory=dict)
    """By column; nothing is asked where it is absent."""
    at_least: bool = False
    """True if large is good."""

    def row(self, column: Column, some: Sequence[Outcome]) -> dict[str, Any]:
        """Reached share, its interval, and the diagnoses that miss."""
        judged = [o for o in some if self.of(o)]
        flags = [self.counted(o) for o in judged]
        misses = [o.job for o, flag in zip(judged, flags, strict=True) if flag != self.at_least]
        return row(self.text, column, flags, self.asked.get(column), misses, at_least=self.at_least)


def _full(o: Outcome) -> bool:
    return o.one.full


GOALS: Final = (
    Goal(
        "false alarms",
        lambda o: o.kind == "null",
        lambda o: o.verdict not in (NONE, REFUSED),
        {"own": 0.04, "foreign": 0.04, "bare": 0.05},
    ),
    Goal(
        "right effect or group first, full size",
        lambda o: o.kind == "single" and _full(o),
        lambda o: o.right_first,
        {"own": 0.98, "foreign": 0.93, "bare": 0.92},
        at_least=True,
    ),
    Goal("the same, half size", lambda o: o.kind == "single" and not _full(o), lambda o: o.right_first, at_least=True),
    Goal("the same, and nothing else", lambda o: o.kind == "single" and _full(o), lambda o: o.exact, at_least=True),
    Goal(
        "both of two, nothing else",
        lambda o: o.kind == "double",
        lambda o: o.exact,
        {"own": 0.88, "foreign": 0.82, "bare": 0.8},
        at_least=True,
    ),
    Goal("all of three, nothing else", lambda o: o.kind == "triple", lambda o: o.exact, at_least=True),
    Goal(
        "outside the catalogue: unknown",
        lambda o: o.kind == "outside" and _full(o),
        lambda o: o.says_more,
        {"own": 0.95, "foreign": 0.88, "bare": 0.88},
        at_least=True,
    ),
    Goal(
        "one or two catalogued causes, wrongly unknown",
        lambda o: o.kind in ("single", "double"),
        lambda o: o.verdict == UNKNOWN,
        {"own": 0.03, "foreign": 0.08, "bare": 0.1},
    ),
    Goal("a wrong name, of all", lambda o: True, lambda o: o.wrong, {"own": 0.04, "foreign": 0.08, "bare": 0.08}),
    Goal("right, of all", lambda o: True, lambda o: o.right, at_least=True),
    Goal("refused", lambda o: True, lambda o: o.verdict == REFUSED),
)


def score(outcomes: Sequence[Outcome], closures: Mapping[str, Mapping[str, Any]]) -> dict[str, Any]:
    """Score every sealed diagnosis of one or several studies.

    Args:
        outcomes: Outcomes.
        closures: By diagnosis, see :func:`studies.blind_diagnosis.closing.closing`.

    Returns:
        Primitives: ``rows`` of goals, ``intervals`` by parameter, ``withheld`` effects, and the ``answers`` themselves.

    Example:
        >>> score([], {})["rows"][0]["n"]
        0
    """
    blind = [o for o in outcomes if o.one.part == "blind"]
    columns: dict[Column, list[Outcome]] = {column: [o for o in blind if column_of(o) == column] for column in COLUMNS}
    truth = {o.one.name: true_sizes(o.one) for o in blind if o.groups}
    rows = [goal.row(column, columns[column]) for goal in GOALS for column in COLUMNS]
    rows += [_closure_row(column, columns[column], closures) for column in COLUMNS]
    return {
        "rows": rows,
        "intervals": [row for column in COLUMNS for row in _intervals(column, columns[column], truth)],
        "withheld": [_withheld(o) for o in outcomes if o.without is not None],
        "answers": [_answer(o) for o in blind],
    }


def column_of(o: Outcome) -> Column:
    """Column of the table.

    Example:
        >>> from studies.blind_diagnosis.blind_plan import SetPlan
        >>> one = SetPlan("blind_0", "blind", "null", {}, 0.0, "all", 400, "simulator_0", 1, "foreign", "MD11")
        >>> column_of(Outcome("blind_0_one", one, "one", None, "none", (), (), (), {}, 9.0))
        'bare'
    """
    return "bare" if o.form in BARE else o.one.world


def row(
    text: str, column: Column, flags: Sequence[bool], asked: float | None, misses: Sequence[str], *, at_least: bool
) -> dict[str, Any]:
    """A goal next to what was reached; ``met`` is None where nothing was asked or nothing can judge it.

    Example:
        >>> row("right", "own", [True, True, False], 0.9, ["blind_2"], at_least=True)["met"]
        False
    """
    reached = share(flags)
    value = reached["share"]
    met = None
    if asked is not None and value is not None:
        met = value >= asked if at_least else value <= asked
    return {"goal": text, "column": column, **reached, "asked": asked, "met": met, "misses": list(misses)}


def _closure_row(column: Column, some: Sequence[Outcome], closures: Mapping[str, Mapping[str, Any]]) -> dict[str, Any]:
    near = {
        o.job: one["error"] is None and abs(one["reported"] - one["measured"]) <= WITHIN[column]
        for o in some
        if (one := closures.get(o.job)) is not None
    }
    text = f"closure within {WITHIN[column]:g} of that measured on fresh flights"
    return row(text, column, list(near.values()), 0.9, [job for job in near if not near[job]], at_least=True)


def _intervals(
    column: Column, some: Sequence[Outcome], truth: Mapping[str, Mapping[str, Mapping[str, float]]]
) -> list[dict[str, Any]]:
    """Coverage of each parameter by itself, next to the median relative error."""
    every = [estimate for o in some if o.groups for estimate in sizes(o, truth[o.one.name])]
    rows = []
    for cause, parameter in sorted({(s["cause"], s["parameter"]) for s in every}):
        of = [s for s in every if (s["cause"], s["parameter"]) == (cause, parameter)]
        covered = share([s["covered"] for s in of])
        errors = sorted((s["estimate"] - s["true"]) / abs(s["true"]) for s in of if s["true"])
        judged = len(of) >= FEWEST_ESTIMATES
        met = COVERAGE[0] <= covered["share"] <= COVERAGE[1] if judged else None
        median = errors[len(errors) // 2] if errors else None
        rows.append({"column": column, "cause": cause, "parameter": parameter, **covered, "error": median, "met": met})
    return rows


def _withheld(o: Outcome) -> dict[str, Any]:
    """An effect that was planted and left out of the catalogue: unknown, or one like it."""
    return {"effect": o.without, "verdict": o.verdict, "named": [sorted(group) for group in o.groups]}


def _answer(o: Outcome) -> dict[str, Any]:
    named = [sorted(group) for group in o.groups]
    about = {"job": o.job, "column": column_of(o), "kind": o.kind, "model": o.one.model, "flights": o.one.flights}
    return about | {"planted": o.one.causes, "verdict": o.verdict, "named": named, "seconds": o.seconds}


def table(scored: Mapping[str, Any]) -> str:
    """The scores as Markdown.

    Example:
        >>> print(table(score([], {})).splitlines()[0])
        | | own | foreign | bare |
    """
    lines = ["| | own | foreign | bare |", "|---|---|---|---|"]
    by_goal: dict[str, dict[str, Mapping[str, Any]]] = {}
    for row in scored["rows"]:
        text = row["goal"] if not row["goal"].startswith("closure") else "closure near that measured on fresh flights"
        by_goal.setdefault(text, {})[row["column"]] = row
    lines += [f"| {text} | {' | '.join(_cell(row_of[c]) for c in COLUMNS)} |" for text, row_of in by_goal.items()]
    lines += ["", "| 90 % intervals | column | hold | of | median error |", "|---|---|---|---|---|"]
    for row in scored["intervals"]:
        error = "" if row["error"] is None else f"{row['error']:+.0%}"
        lines.append(f"| {row['cause']} {row['parameter']} | {row['column']} | {_cell(row)} | {row['n']} | {error} |")
    lines += ["", "| withheld from the catalogue | verdict | named |", "|---|---|---|"]
    for row in scored["withheld"]:
        named = ", ".join(" or ".join(group) for group in row["named"])
        lines.append(f"| {row['effect']} | {row['verdict']} | {named} |")
    return "\n".join(lines)


def _cell(share_of: Mapping[str, Any]) -> str:
    if share_of["share"] is None:
        return "-"
    met = {True: "", False: " **missed**", None: ""}[share_of["met"]]
    return f"{share_of['share']:.1%} ({share_of['low']:.0%} to {share_of['high']:.0%}, n {share_of['n']}){met}"


def share(flags: Sequence[bool]) -> dict[str, Any]:
    """Share of true flags with its 95 % interval (Wilson); None where there is no flag.

    Example:
        >>> share([True, True, True, False])
        {'n': 4, 'share': 0.75, 'low': 0.30..., 'high': 0.95...}
    """
    if not flags:
        return {"n": 0, "share": None, "low": None, "high": None}
    interval = stats.binomtest(sum(flags), len(flags)).proportion_ci(0.95, "wilson")
    return {"n": len(flags), "share": sum(flags) / len(flags), "low": float(interval.low), "high": float(interval.high)}
