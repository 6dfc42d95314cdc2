"""The goals that were set for the diagnosis, each beside what was reached."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any, Final

import numpy as np

from descentflow.studies.blind_diagnosis.outcome import UNKNOWN, Outcome

SURVIVES_REFIT: Final = (
    "temperature",
    "wind_gradient",
    "speed_brake",
    "airspeed_bias",
    "vertical_rate_lag",
    "measurement_noise",
)
"""Sensors, windows and measured covariates: what a simulator refitted to the flights still cannot hide."""


def goals(blind: Sequence[Outcome], scored: Mapping[str, Any]) -> list[dict[str, Any]]:
    """Goal, what was reached, of how many sets, and whether it is met.

    Unless a goal says otherwise, it is judged on 400 flights against a simulator of 400, effects of full size, the
    simulator's polar right.

    Args:
        blind: Outcomes of the blind sets.
        scored: Scores so far: ``false_alarms``, ``sizes``, ``withheld`` and ``refit`` of
            :func:`descentflow.studies.blind_diagnosis.blind_score.score`.

    Returns:
        Rows of ``goal reached reached_text n met``; ``met`` is None where no set can judge a goal.

    Example:
        >>> alarms, sizes = {"share": 0.02, "uniform_p": 0.4, "n": 100}, {"coverage": {"share": 0.9, "n": 50}}
        >>> found = goals([], {"false_alarms": alarms, "sizes": sizes, "withheld": [], "refit": []})
        >>> found[0]["goal"], found[0]["met"], found[2]["met"]
        ('false alarms at most 5 %', True, None)
    """
    plain = [o for o in blind if o.one.flights == 400 and o.one.size >= 0.7 and not o.wrong_polar]
    rich = [o for o in plain if o.one.channels == "all"]
    poor = [o for o in plain if o.one.channels == "basic"]
    single: Callable[[Sequence[Outcome]], list[Outcome]] = lambda some: [o for o in some if o.one.kind == "single"]  # noqa: E731
    polar = [o for o in single(blind) if o.one.flights == 400 and o.one.size >= 0.7 and o.wrong_polar]
    outside = [o for o in plain if o.one.kind == "outside"]
    doubles = [o for o in rich if o.one.kind == "double"]
    alarms, coverage = scored["false_alarms"], scored["sizes"]["coverage"]
    return [
        _goal("false alarms at most 5 %", alarms["share"], alarms["n"], most=0.05),
        _goal(
            "p-values of null sets uniform (p of the KS test above 0.05)", alarms["uniform_p"], alarms["n"], least=0.05
        ),
        _goal(
            "right effect first, all channels, at least 95 %", *_rate([o.right_first for o in single(rich)]), least=0.95
        ),
        _goal(
            "truth in the group, without TAS and groundspeed, at least 95 %",
            *_rate([o.in_group for o in single(poor)]),
            least=0.95,
        ),
        _goal(
            "outside the catalogue called unknown, at least 90 %",
            *_rate([o.verdict == UNKNOWN for o in outside]),
            least=0.9,
        ),
        _goal(
            "catalogued effects wrongly called unknown, at most 5 %",
            *_rate([o.verdict == UNKNOWN for o in single(plain)]),
            most=0.05,
        ),
        _goal(
            "two effects at once, exact set, all channels, at least 85 %",
            *_rate([o.exact for o in doubles]),
            least=0.85,
        ),
        _goal("90 % intervals cover 85 to 95 %", coverage["share"], coverage["n"], least=0.85, most=0.95),
        _goal(
            "corrected simulators close what the true effect closes, at least 0.9 of it (median)",
            *_of_true(scored, window=False),
            least=0.9,
        ),
        _goal("the same of windows, at least 0.75", *_of_true(scored, window=True), least=0.75),
        _goal(
            "with the wrong polar, truth in the group, at least 85 %", *_rate([o.in_group for o in polar]), least=0.85
        ),
        _goal(
            "after refitting: sensors, windows and measured covariates found, all",
            *_rate([r["right_first"] for r in scored["refit"] if r["effect"] in SURVIVES_REFIT]),
            least=1.0,
        ),
        _goal(
            "after refitting: nothing else named wrongly",
            *_rate([not r["named"] or r["in_group"] for r in scored["refit"] if r["effect"] not in SURVIVES_REFIT]),
            least=1.0,
        ),
        _goal(
            "withheld from the catalogue: called unknown, or its group named",
            *_rate([r["right_without"] for r in scored["withheld"]]),
            least=1.0,
        ),
        _goal("put back: found", *_rate([r["right_with"] for r in scored["withheld"]]), least=1.0),
    ]


def _rate(flags: Sequence[bool]) -> tuple[float | None, int]:
    return (sum(flags) / len(flags) if flags else None), len(flags)


def _of_true(scored: Mapping[str, Any], *, window: bool) -> tuple[float | None, int]:
    rows = [row for row in scored["withheld"] if (row["effect"] == "speed_brake") == window and row["closing"]]
    values = [row["closing"]["of_true"] for row in rows if row["closing"]["of_true"] is not None]
    return (float(np.median(values)) if values else None), len(values)


def _goal(
    goal: str, reached: float | None, n: int, *, least: float | None = None, most: float | None = None
) -> dict[str, Any]:
    met = None
    if reached is not None:
        met = (least is None or reached >= least) and (most is None or reached <= most)
    text = "no set" if reached is None else f"{reached:.3g}"
    return {"goal": goal, "reached": reached, "reached_text": text, "n": n, "met": met}
