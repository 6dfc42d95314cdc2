"""Tables of a study's scores: by kind, size and channels, cause by cause, sizes, windows, closures."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
from scipy import stats

from descentflow.simulation.causes import CATALOGUED
from studies.blind_diagnosis.binomial_share import share
from studies.blind_diagnosis.blind_plan import SCALE_GROUP
from studies.blind_diagnosis.blind_worlds import StudyWorld
from studies.blind_diagnosis.outcome import NONE, REFUSED, UNKNOWN, Outcome, overlap, sizes


def false_alarms(blind: Sequence[Outcome]) -> dict[str, Any]:
    """Alarms of sets that hide nothing, and whether their p-values are uniform.

    Example:
        >>> false_alarms([])["n"]
        0
    """
    null = [o for o in blind if o.kind == "null"]
    p_values = [o.p_value for o in null if o.p_value is not None]
    test = stats.kstest(p_values, "uniform") if p_values else None
    return {
        **share([o.verdict != NONE for o in null]),
        "p_values": sorted(p_values),
        "uniform_statistic": None if test is None else float(test.statistic),
        "uniform_p": None if test is None else float(test.pvalue),
        "named": [list(o.named) or [o.verdict] for o in null if o.verdict != NONE],
    }


def strata(blind: Sequence[Outcome]) -> list[dict[str, Any]]:
    """Detection, isolation and abstention by what makes a set easy or hard.

    Example:
        >>> strata([])
        []
    """
    rows = []
    keys: dict[str, Callable[[Outcome], Any]] = {
        "channels": lambda o: o.one.channels,
        "size": lambda o: "full" if o.one.full else "half",
        "flights differ": lambda o: "yes" if o.one.varying else "no",
        "aircraft": lambda o: o.one.model,
        "flights": lambda o: o.one.flights,
        "simulator": lambda o: "wrong polar" if o.wrong_polar else "matched",
    }
    for kind in ("single", "double", "outside"):
        of = [o for o in blind if o.kind == kind]
        for key, value_of in keys.items():
            for value in sorted({value_of(o) for o in of}):
                some = [o for o in of if value_of(o) == value]
                rows.append({"kind": kind, "by": key, "value": str(value), **rates(some)})
    return rows


def rates(some: Sequence[Outcome]) -> dict[str, Any]:
    """Numbers of sets that were detected, named first, in the group, exactly, or called unknown.

    Example:
        >>> sorted(rates([]))
        ['detected', 'exact', 'first', 'in_group', 'n', 'unknown']
    """
    return {
        "n": len(some),
        "detected": share([o.verdict not in (NONE, REFUSED) for o in some]),
        "first": share([o.right_first for o in some]),
        "in_group": share([o.in_group for o in some]),
        "exact": share([o.exact for o in some]),
        "unknown": share([o.verdict == UNKNOWN for o in some]),
    }


_NAMED = tuple(cause.name for cause in CATALOGUED)
CONFUSIONS: dict[str, Callable[[Outcome], bool]] = {
    "all channels": lambda o: o.one.channels == "all",
    "without TAS and groundspeed": lambda o: o.one.channels == "basic",
}


def confusion_table(world: StudyWorld, some: Sequence[Outcome]) -> dict[str, Any]:
    """Counts of what is named first (columns) for each injected cause (rows); others are scored elsewhere.

    Example:
        >>> from studies.blind_diagnosis.blind_worlds import FOREIGN
        >>> confusion_table(FOREIGN, [])["rows"][-3:]  # outside the catalogue
        ['kept_thrust', 'anti_ice', 'wave_drag']
    """
    columns = [NONE, *_NAMED, UNKNOWN, REFUSED]
    rows = [NONE, *world.catalogued, *world.outside]
    table = np.zeros((len(rows), len(columns)), dtype=int)
    for o in some:
        if o.kind not in ("null", "single", "outside"):
            continue
        row = rows.index(next(iter(o.one.causes), NONE))
        table[row, columns.index(o.first if o.first in columns else UNKNOWN)] += 1
    return {"rows": rows, "columns": columns, "table": table.tolist(), "outside": len(world.outside)}


def by_cause_table(world: StudyWorld, blind: Sequence[Outcome]) -> list[dict[str, Any]]:
    """Rates of each cause by itself, by channels and size.

    Example:
        >>> from studies.blind_diagnosis.blind_worlds import OWN
        >>> by_cause_table(OWN, [])
        []
    """
    return [
        {"cause": cause, "channels": channels, "size": size, **rates(some)}
        for cause in (*world.catalogued, *world.outside)
        for channels in ("all", "basic")
        for size in ("full", "half")
        if (
            some := [
                o
                for o in blind
                if list(o.one.causes) == [cause] and o.one.channels == channels and (size == "full") == o.one.full
            ]
        )
    ]


def estimated_sizes(blind: Sequence[Outcome]) -> dict[str, Any]:
    """Bias and coverage of the estimates; those of the scale group only where no wrong polar adds to them.

    Example:
        >>> estimated_sizes([])["rows"]
        []
    """
    every = [s for o in blind for s in sizes(o) if not (o.wrong_polar and s["cause"] in SCALE_GROUP)]
    rows = []
    for cause, parameter in sorted({(s["cause"], s["parameter"]) for s in every}):
        of = [s for s in every if (s["cause"], s["parameter"]) == (cause, parameter)]
        errors = [(s["estimate"] - s["true"]) / abs(s["true"]) for s in of if s["true"]]
        rows.append(
            {
                "cause": cause,
                "parameter": parameter,
                "unit": of[0]["unit"],
                "bias": float(np.median(errors)) if errors else None,
                "spread": float(np.subtract(*np.quantile(errors, [0.75, 0.25]))) if errors else None,
                "coverage": share([s["covered"] for s in of]),
                "missed": [s["job"] for s in of if not s["covered"]],
            }
        )
    return {"rows": rows, "coverage": share([s["covered"] for s in every]), "estimates": every}


def claimed_closures(blind: Sequence[Outcome]) -> list[dict[str, Any]]:
    """Closures that right answers claim, and those that their rivals would have claimed.

    Example:
        >>> claimed_closures([])
        []
    """
    rows = []
    for o in blind:
        if o.kind != "single" or not o.right_first or o.wrong_polar:
            continue
        cause = o.report["causes"][0]
        closures = {
            kind: (cause["closure"].get(kind) or {}).get("estimate") for kind in ("marginal", "conditional", "transfer")
        }
        rivals = [_closure_of(rival) for rival in _rival_entries(cause)]
        rows.append(
            {
                "job": o.job,
                "cause": next(iter(o.one.causes)),
                "size": o.one.size,
                "channels": o.one.channels,
                **closures,
            }
            | {"best_rival": max((r for r in rivals if r is not None), default=None)}
        )
    return rows


def _rival_entries(cause: Mapping[str, Any]) -> list[Any]:
    """Rivals of a cause, however the report lists them."""
    rivals = cause.get("rivals") or []
    return list(rivals.values()) if isinstance(rivals, Mapping) else list(rivals)


def _closure_of(rival: Any) -> float | None:
    """Closure that a rival would have claimed."""
    value = rival.get("closure") if isinstance(rival, Mapping) else rival
    if isinstance(value, Mapping):
        value = value.get("marginal", value.get("estimate"))
    if isinstance(value, Mapping):
        value = value.get("estimate")
    return None if value is None else float(value)


def windows(blind: Sequence[Outcome]) -> list[dict[str, Any]]:
    """Windows injected beside the windows named and the levels where the rate was said to differ most.

    Example:
        >>> windows([])
        []
    """
    rows = []
    for o in blind:
        truth = o.one.causes.get("speed_brake")
        if truth is None or len(o.one.causes) > 1:
            continue
        injected = truth["low_fl"], truth["high_fl"]
        cause = next((c for c in o.report.get("causes", []) if c["effect"] == "speed_brake"), None)
        named = None if cause is None else [cause["parameters"][end]["estimate"] for end in ("low_fl", "high_fl")]
        cell = next((c for c in o.report.get("where", []) if c["quantity"] == "rate"), None)
        place = None if cell is None else [cell["level_low_fl"], cell["level_high_fl"]]
        row: dict[str, Any] = {
            "job": o.job,
            "injected": list(injected),
            "found": named,
            "cell": place,
            "overlap": None,
            "cell_in": None,
        }
        if named is not None:
            row["overlap"] = overlap(*injected, *named)
        if place is not None:
            row["cell_in"] = overlap(*injected, *place) > 0
        rows.append(row)
    return rows


def withheld_effects(found: Sequence[Outcome], closings: Mapping[str, Any]) -> list[dict[str, Any]]:
    """Each effect injected, diagnosed without it in the catalogue and with it.

    Example:
        >>> withheld_effects([], {})
        []
    """
    rows = []
    with_it = {o.one.name: o for o in found if o.one.part == "withheld" and o.without is None}
    for o in found:
        if o.without is None or o.one.name not in with_it:
            continue
        other = with_it[o.one.name]
        confusable = set(SCALE_GROUP if o.without in SCALE_GROUP else ()) | (
            set(other.groups[0]) if other.groups else set()
        )
        as_group = bool(o.named) and o.named[0] in confusable
        rows.append(
            {
                "effect": o.without,
                "without": _brief(o),
                "with": _brief(other),
                "right_without": o.verdict == UNKNOWN or as_group,
                "right_with": other.right_first,
                "closing": closings.get(other.one.name),
            }
        )
    return rows


def _brief(o: Outcome) -> dict[str, Any]:
    causes = o.report.get("causes", [])
    marginal = (causes[0]["closure"].get("marginal") or {}).get("estimate") if causes else None
    top = (o.report.get("where") or [None])[0]
    return {
        "verdict": o.verdict,
        "named": list(o.named),
        "groups": [sorted(group) for group in o.groups],
        "gap_before": o.report.get("gap_before"),
        "gap_after": o.report.get("gap_after"),
        "floor": o.report.get("floor"),
        "closure": marginal,
        "where": top,
        "p_value": o.p_value,
    }


def refitted(found: Sequence[Outcome]) -> list[dict[str, Any]]:
    """Simulators that were trained on flights with the same cause.

    Example:
        >>> refitted([])
        []
    """
    return [
        {"effect": next(iter(o.one.causes)), "right_first": o.right_first, "in_group": o.in_group, **_brief(o)}
        for o in found
        if o.one.part == "refit"
    ]
