"""The scores of a study, once its key is open."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
from scipy import stats

from descentflow.simulation.causes import CATALOGUED, OUTSIDE
from descentflow.studies.blind_diagnosis.blind_plan import SCALE_GROUP, Plan
from descentflow.studies.blind_diagnosis.goals import goals
from descentflow.studies.blind_diagnosis.outcome import NONE, REFUSED, UNKNOWN, Outcome, outcomes, overlap, sizes

SCHEMA_VERSION = 1


def score(
    plan: Plan,
    manifest: Mapping[str, Any],
    diagnoses: Mapping[str, Any],
    closings: Mapping[str, Any] | None = None,
) -> dict[str, Any]:
    """Score every sealed diagnosis.

    Args:
        plan: The key.
        manifest: What was published.
        diagnoses: Sealed diagnoses by job.
        closings: See :func:`descentflow.studies.blind_diagnosis.closing.closing`, by job of an effect that was put
            back.

    Returns:
        Primitives for ``score.json``.

    Example:
        >>> from descentflow.studies.blind_diagnosis.blind_plan import draw_plan
        >>> manifest = {"key_sha256": "00", "sealed_at": "today", "jobs": []}
        >>> score(draw_plan(20, seed=1), manifest, {})["diagnosed"]
        0
    """
    found = outcomes(plan, manifest, diagnoses)
    blind = [o for o in found if o.one.part == "blind"]
    scored: dict[str, Any] = {
        "schema_version": SCHEMA_VERSION,
        "key_sha256": manifest["key_sha256"],
        "sealed_at": manifest["sealed_at"],
        "jobs": len(manifest["jobs"]),
        "diagnosed": len(found),
        "refused": [{"job": o.job, "error": diagnoses[o.job]["refused"]} for o in found if o.verdict == REFUSED],
        "seconds": _seconds(found),
        "false_alarms": _false_alarms(blind),
        "by_stratum": _strata(blind),
        "confusion": {name: _confusion([o for o in blind if keep(o)]) for name, keep in _CONFUSIONS.items()},
        "by_cause": _by_cause(blind),
        "sizes": _sizes(blind),
        "closure": _closure(blind),
        "windows": _windows(blind),
        "withheld": _withheld(found, closings or {}),
        "refit": _refit(found),
    }
    return {**scored, "goals": goals(blind, scored)}


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


def _seconds(found: Sequence[Outcome]) -> dict[str, float | None]:
    by_size = {n: [o.seconds for o in found if o.one.flights == n] for n in sorted({o.one.flights for o in found})}
    return {str(n): float(np.median(values)) for n, values in by_size.items()}


def _false_alarms(blind: Sequence[Outcome]) -> dict[str, Any]:
    null = [o for o in blind if o.one.kind == "null"]
    p_values = [o.p_value for o in null if o.p_value is not None]
    test = stats.kstest(p_values, "uniform") if p_values else None
    return {
        **share([o.verdict != NONE for o in null]),
        "p_values": sorted(p_values),
        "uniform_statistic": None if test is None else float(test.statistic),
        "uniform_p": None if test is None else float(test.pvalue),
        "named": [list(o.named) or [o.verdict] for o in null if o.verdict != NONE],
    }


def _strata(blind: Sequence[Outcome]) -> list[dict[str, Any]]:
    """Detection, isolation and abstention by what makes a set easy or hard."""
    rows = []
    keys: dict[str, Callable[[Outcome], Any]] = {
        "channels": lambda o: o.one.channels,
        "size": lambda o: "half" if o.one.size < 0.7 else "full",
        "flights": lambda o: o.one.flights,
        "simulator": lambda o: "wrong polar" if o.wrong_polar else "matched",
    }
    for kind in ("single", "double", "outside"):
        of = [o for o in blind if o.one.kind == kind]
        for key, value_of in keys.items():
            for value in sorted({value_of(o) for o in of}):
                some = [o for o in of if value_of(o) == value]
                rows.append({"kind": kind, "by": key, "value": str(value), **_rates(some)})
    return rows


def _rates(some: Sequence[Outcome]) -> dict[str, Any]:
    return {
        "n": len(some),
        "detected": share([o.verdict not in (NONE, REFUSED) for o in some]),
        "first": share([o.right_first for o in some]),
        "in_group": share([o.in_group for o in some]),
        "exact": share([o.exact for o in some]),
        "unknown": share([o.verdict == UNKNOWN for o in some]),
    }


_CONFUSIONS: dict[str, Callable[[Outcome], bool]] = {
    "all channels": lambda o: o.one.channels == "all",
    "without TAS and groundspeed": lambda o: o.one.channels == "basic",
}


def _confusion(some: Sequence[Outcome]) -> dict[str, Any]:
    """Counts of what is named first (columns) for each injected cause (rows); doubles are scored elsewhere."""
    columns = [NONE, *(cause.name for cause in CATALOGUED), UNKNOWN, REFUSED]
    rows = [NONE, *(cause.name for cause in (*CATALOGUED, *OUTSIDE))]
    table = np.zeros((len(rows), len(columns)), dtype=int)
    for o in some:
        if o.one.kind == "double":
            continue
        row = rows.index(next(iter(o.one.causes), NONE))
        table[row, columns.index(o.first if o.first in columns else UNKNOWN)] += 1
    return {"rows": rows, "columns": columns, "table": table.tolist()}


def _by_cause(blind: Sequence[Outcome]) -> list[dict[str, Any]]:
    return [
        {"cause": cause.name, "channels": channels, "size": size, **_rates(some)}
        for cause in (*CATALOGUED, *OUTSIDE)
        for channels in ("all", "basic")
        for size in ("full", "half")
        if (
            some := [
                o
                for o in blind
                if list(o.one.causes) == [cause.name]
                and o.one.channels == channels
                and (size == "half") == (o.one.size < 0.7)
            ]
        )
    ]


def _sizes(blind: Sequence[Outcome]) -> dict[str, Any]:
    """Bias and coverage of the estimates; those of the scale group only where no wrong polar adds to them."""
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
            }
        )
    return {"rows": rows, "coverage": share([s["covered"] for s in every]), "estimates": every}


def _closure(blind: Sequence[Outcome]) -> list[dict[str, Any]]:
    """Closures that right answers claim, and those that their rivals would have claimed."""
    rows = []
    for o in blind:
        if o.one.kind != "single" or not o.right_first or o.wrong_polar:
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


def _windows(blind: Sequence[Outcome]) -> list[dict[str, Any]]:
    """Windows injected beside the windows named and the levels where the rate was said to differ most."""
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


def _withheld(found: Sequence[Outcome], closings: Mapping[str, Any]) -> list[dict[str, Any]]:
    """Each effect injected, diagnosed without it in the catalogue and with it."""
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
                "closing": closings.get(other.job),
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


def _refit(found: Sequence[Outcome]) -> list[dict[str, Any]]:
    """Simulators that were trained on flights with the same cause."""
    return [
        {"effect": next(iter(o.one.causes)), "right_first": o.right_first, "in_group": o.in_group, **_brief(o)}
        for o in found
        if o.one.part == "refit"
    ]
