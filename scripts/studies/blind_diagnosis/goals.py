"""The goals that were set for the diagnosis, each beside what was reached and its interval; misses are listed."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from studies.blind_diagnosis.binomial_share import share
from studies.blind_diagnosis.outcome import NONE, Outcome

FEWEST_ESTIMATES: Final = 20
"""Intervals of a parameter below which its coverage is not judged: of 20 that are right, 17 to 19 cover."""
SURVIVES_REFIT: Final = (
    "temperature",
    "wind_gradient",
    "speed_brake",
    "airspeed_bias",
    "vertical_rate_lag",
    "measurement_noise",
)
"""Sensors, windows and measured covariates: what a simulator refitted to the flights still cannot hide."""


@dataclass(frozen=True)
class WorldGoals:
    """Goals in a world."""

    false_alarms: float
    first: float
    in_group: float
    both: float
    unknown: float
    wrongly_unknown: float
    coverage: tuple[float, float]
    closure: float


GOALS: Final = {
    "own": WorldGoals(0.05, 0.97, 0.95, 0.85, 0.95, 0.03, (0.85, 0.95), 0.95),
    "foreign": WorldGoals(0.05, 0.9, 0.9, 0.8, 0.9, 0.1, (0.8, 0.95), 0.85),
}
SAME_VERDICTS: Final = 0.98
Row = dict[str, Any]


def goals(blind: Sequence[Outcome], scored: Mapping[str, Any]) -> list[Row]:
    """Goal, what was reached with its 95 % interval, of how many sets, whether it is met, and which sets miss.

    Sets of one effect are judged at full size and against a polar that is right; half sizes and wrong polars are listed
    without a goal. Two effects are judged at all sizes. A verdict that something remains which no cause explains
    (``partial``) counts as unknown.

    Args:
        blind: Outcomes of the blind sets, diagnosed by their checkpoint.
        scored: Scores so far, as :func:`studies.blind_diagnosis.blind_score.score` collects them.

    Returns:
        Rows of ``goal reached low high reached_text n met misses``; ``met`` is None where nothing was asked or no set
        can judge it.

    Example:
        >>> from studies.blind_diagnosis.blind_draw import draw_plan
        >>> from studies.blind_diagnosis.blind_score import score
        >>> rows = score(draw_plan(20, seed=1), {"key_sha256": "00", "sealed_at": "today", "jobs": []}, {})["goals"]
        >>> rows[0]["goal"], rows[0]["met"]
        ('own: false alarms, at most 5 %', None)
    """
    rows: list[Row] = []
    for world, asked in GOALS.items():
        of = [o for o in blind if o.one.world == world]
        rows += _of_world(f"{world}: ", asked, of, scored["worlds"][world])
    same = scored["same_verdicts"]
    differing = [row["set"] for row in same["differing"]]
    rows.append(
        _row(
            f"the same verdicts for flights of the simulator, at least {SAME_VERDICTS:.0%}",
            same,
            differing,
            least=SAME_VERDICTS,
        )
    )
    return rows + _without_and_refit(scored)


def _of_world(world: str, asked: WorldGoals, of: Sequence[Outcome], scored: Mapping[str, Any]) -> list[Row]:
    """Goals of one world."""
    null = [o for o in of if o.kind == "null"]
    singles = [o for o in of if o.kind == "single"]
    plain = [o for o in singles if o.one.full and not o.wrong_polar]
    rich, poor = ([o for o in plain if o.one.channels == channels] for channels in ("all", "basic"))
    doubles = [o for o in of if o.kind == "double" and o.one.channels == "all" and not o.wrong_polar]
    outside = [o for o in of if o.kind == "outside" and o.one.full and not o.wrong_polar]
    half = [o for o in singles if not o.one.full and not o.wrong_polar]
    uniform = scored["false_alarms"]["uniform_p"]
    rows = [
        _most(world + "false alarms", asked.false_alarms, null, lambda o: o.verdict != NONE),
        _number(world + "p-values of null sets uniform (p of the KS test above 0.05)", uniform, len(null), least=0.05),
        _least(world + "right effect first, all channels", asked.first, rich, _first),
        _least(world + "truth in the group, without TAS and groundspeed", asked.in_group, poor, _in_group),
        _least(world + "both of two and nothing else, all channels", asked.both, doubles, _exact),
        _least(world + "outside the catalogue called unknown", asked.unknown, outside, _says_more),
        _most(world + "catalogued effects wrongly called unknown", asked.wrongly_unknown, plain, _says_more),
        *_coverage(world, asked, scored["sizes"]["rows"]),
        _closure(world, asked, scored["of_true"]),
        _asked_nothing(world + "half sizes: right effect first", half, _first),
        _asked_nothing(world + "wrong polar: truth in the group", [o for o in singles if o.wrong_polar], _in_group),
        _asked_nothing(world + "both of two, one at half size", [o for o in doubles if not o.one.full], _exact),
        _asked_nothing(world + "flights that differ: right effect first", [o for o in plain if o.one.varying], _first),
    ]
    for wanted in ("named", "rest"):
        beside = scored["mixed"]
        text = {"named": "catalogued beside outside: named", "rest": "catalogued beside outside: the rest is told"}
        misses = [row["job"] for row in beside if not row[wanted]]
        rows.append(_row(world + text[wanted], share([row[wanted] for row in beside]), misses))
    return rows


def _first(o: Outcome) -> bool:
    return o.right_first


def _in_group(o: Outcome) -> bool:
    return o.in_group


def _exact(o: Outcome) -> bool:
    return o.exact


def _says_more(o: Outcome) -> bool:
    return o.says_more


def _coverage(world: str, asked: WorldGoals, rows: Sequence[Mapping[str, Any]]) -> list[Row]:
    """Each parameter by itself."""
    low, high = asked.coverage
    found = []
    for row in rows:
        coverage, name = row["coverage"], f"{row['cause']} {row['parameter']}"
        asks = {"least": low, "most": high} if coverage["n"] >= FEWEST_ESTIMATES else {}
        found.append(
            _row(f"{world}90 % intervals of {name} cover {low:.0%} to {high:.0%}", coverage, row["missed"], **asks)
        )
    return found


def _closure(world: str, asked: WorldGoals, rows: Sequence[Mapping[str, Any]]) -> Row:
    """Median over the sets whose true effect acts where it can be seen."""
    values = {row["set"]: row["of_true"] for row in rows if row["of_true"] is not None}
    reached = float(np.median(list(values.values()))) if values else None
    misses = [name for name, value in values.items() if value < asked.closure]
    text = f"{world}closed of what the true effect closes (median), at least {asked.closure:g}"
    return _number(text, reached, len(values), least=asked.closure, misses=misses)


def _without_and_refit(scored: Mapping[str, Any]) -> list[Row]:
    """Effects withheld from the catalogue and put back, and simulators refitted to the flights."""
    refit, withheld = scored["refit"], scored["withheld"]
    survives = [r for r in refit if r["effect"] in SURVIVES_REFIT]
    others = [r for r in refit if r["effect"] not in SURVIVES_REFIT]
    flags: list[tuple[str, list[tuple[str, bool]]]] = [
        (
            "after refitting: sensors, windows and measured covariates found, all",
            [(r["effect"], bool(r["right_first"])) for r in survives],
        ),
        (
            "after refitting: nothing else named wrongly",
            [(r["effect"], not r["named"] or bool(r["in_group"])) for r in others],
        ),
        (
            "withheld from the catalogue: called unknown, or its group named",
            [(r["effect"], bool(r["right_without"])) for r in withheld],
        ),
        ("put back: found", [(r["effect"], bool(r["right_with"])) for r in withheld]),
    ]
    return [
        _row(text, share([right for _, right in some]), [name for name, right in some if not right], least=1.0)
        for text, some in flags
    ]


def _least(goal: str, least: float, some: Sequence[Outcome], right: Callable[[Outcome], bool]) -> Row:
    misses = [o.job for o in some if not right(o)]
    return _row(f"{goal}, at least {least:.0%}", share([right(o) for o in some]), misses, least=least)


def _most(goal: str, most: float, some: Sequence[Outcome], wrong: Callable[[Outcome], bool]) -> Row:
    misses = [o.job for o in some if wrong(o)]
    return _row(f"{goal}, at most {most:.0%}", share([wrong(o) for o in some]), misses, most=most)


def _asked_nothing(goal: str, some: Sequence[Outcome], right: Callable[[Outcome], bool]) -> Row:
    return _row(goal, share([right(o) for o in some]), [o.job for o in some if not right(o)])


def _number(goal: str, reached: float | None, n: int, *, least: float, misses: Sequence[str] = ()) -> Row:
    """A goal that is no share."""
    return _row(goal, {"share": reached, "low": None, "high": None, "n": n}, misses, least=least)


def _row(
    goal: str,
    reached: Mapping[str, Any],
    misses: Sequence[str],
    *,
    least: float | None = None,
    most: float | None = None,
) -> Row:
    """A goal beside its share; nothing is met where nothing was asked."""
    value, met, text = reached["share"], None, "no set"
    if value is not None:
        text = f"{value:.3g}"
        if reached["low"] is not None:
            text += f" ({reached['low']:.2f} to {reached['high']:.2f})"
        if least is not None or most is not None:
            met = (least is None or value >= least) and (most is None or value <= most)
    ends = {"low": reached["low"], "high": reached["high"]}
    return {
        "goal": goal.replace(" %", "%").replace("%", " %"),
        "reached": value,
        **ends,
        "reached_text": text,
        "n": reached["n"],
        "met": met,
        "misses": list(misses),
    }
