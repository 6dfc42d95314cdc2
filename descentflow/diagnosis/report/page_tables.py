"""Tables of a diagnosis: costs with the part of each cause, both inputs, and the numbers for specialists."""

from descentflow.diagnosis.findings.aviation_units import aviation_value, between, level_range, with_unit
from descentflow.diagnosis.findings.costs_found import Cost
from descentflow.diagnosis.findings.findings import Findings
from descentflow.diagnosis.findings.inputs_found import InputUsed
from descentflow.diagnosis.findings.plain_values import percent
from descentflow.measurements.quantity_registry import label_of

CELLS_LISTED = 8
"""Cells of the table of where, largest share first."""
SETS_LISTED = 5
"""Sets of effects that are listed."""
OF_STRETCHES = ("level", "slow")
"""Costs of level-offs and slow stretches."""
BY_LEVEL = ("time", "time_at_speed", "rate")
"""Costs that are listed by level."""
Table = tuple[str, list[str], list[list[str]], str]
"""Heading, names of the columns, rows, and how columns are aligned."""


def whole_costs(findings: Findings) -> list[Cost]:
    """Costs over all levels.

    Example:
        >>> from descentflow.diagnosis.diagnose import diagnose
        >>> from descentflow.effects import EFFECTS, UNKNOWN
        >>> whole_costs(diagnose("descents.parquet", "A320", catalogue={"mass": EFFECTS["mass"]}))[0].unit
        's'
    """
    return [c for c in findings.costs if (c.low_fl, c.high_fl) == (findings.costs[0].low_fl, findings.costs[0].high_fl)]


def shown_costs(findings: Findings) -> list[Cost]:
    """Costs over all levels: of both distances the one over ground, and stretches only where they differ surely.

    Example:
        >>> from descentflow.diagnosis.diagnose import diagnose
        >>> from descentflow.effects import EFFECTS
        >>> report = diagnose("descents.parquet", "A320", catalogue={"mass": EFFECTS["mass"]})
        >>> [cost.name for cost in shown_costs(report)][:2]
        ['time', 'time_at_speed']
    """
    costs = whole_costs(findings)
    hidden = {"air_distance"} if any(cost.name == "ground_distance" for cost in costs) else set()
    hidden |= {cost.name for cost in costs if cost.name in OF_STRETCHES and not cost.before.excludes_zero}
    return [cost for cost in costs if cost.name not in hidden]


def cost_table(findings: Findings, *, means: bool = False) -> list[list[str]]:
    """Head and rows: each cost, what each cause takes of it, what is left, and what chance gives.

    Args:
        findings: What the diagnosis found.
        means: Whether the means of both sides stand before the difference.

    Example:
        >>> from descentflow.diagnosis.diagnose import diagnose
        >>> from descentflow.effects import EFFECTS, UNKNOWN
        >>> cost_table(diagnose("descents.parquet", "A320", catalogue={"mass": EFFECTS["mass"]}))[0]
        ['', 'difference', 'mass', 'left', 'by chance']
    """
    after = bool(findings.causes) and any(cost.after is not None for cost in findings.costs)
    causes = [cause for cause in findings.causes if cause.takes_away]
    head = ["", *(["simulator", "real flights"] if means else []), "difference"]
    head += [cause.label or cause.effect for cause in causes] + (["left"] if after else [])
    rows = []
    for cost in shown_costs(findings):
        row = [cost.label, *(with_unit(x, cost.unit) for x in (cost.simulator, cost.flights) if means)]
        row.append(between(cost.before, cost.unit))
        taken = [cause.takes_away.get(cost.name, 0.0) for cause in causes]
        row += [with_unit(size, cost.unit, signed=True) if size else "-" for size in taken]
        row += ["-" if cost.after is None else between(cost.after, cost.unit)] if after else []
        rows.append([*row, with_unit(cost.floor, cost.unit)])
    return [[*head, "by chance"], *rows]


def inputs_table(findings: Findings) -> list[list[str]]:
    """Both sides by name, kind, flights, days, types and version; empty where nothing is known of them.

    Example:
        >>> from descentflow.diagnosis.diagnose import diagnose
        >>> from descentflow.effects import EFFECTS
        >>> inputs_table(diagnose("descents.parquet", "A320", catalogue={"mass": EFFECTS["mass"]}))[0]
        ['name', 'descents.parquet', 'nominal A320']
    """
    made = findings.provenance
    if not made.real.flights:
        return []
    sides = (_side(made.real), _side(made.simulator))
    rows = [[name, *(side[name] for side in sides)] for name in sides[0]]
    return [row for row in rows if set(row[1:]) != {"-"}]


def _side(used: InputUsed) -> dict[str, str]:
    days = " to ".join(dict.fromkeys(day for day in (used.first, used.last) if day))
    files = [file for file in used.files if file != used.name]
    return {
        "name": used.name,
        "files of rows": ", ".join(files) or "-",
        "kind": used.kind,
        "flights": f"{used.flights:,}" if used.flights else "-",
        "aircraft": f"{used.aircraft:,}" if used.aircraft else "-",
        "days": days or "-",
        "types": ", ".join(used.typecodes) or "-",
        "descentflow": used.version or "-",
    }


def specialist_tables(findings: Findings) -> list[Table]:
    """Every further number that the page has; tables without rows are not shown.

    Example:
        >>> from descentflow.diagnosis.diagnose import diagnose
        >>> from descentflow.effects import EFFECTS
        >>> report = diagnose("descents.parquet", "A320", catalogue={"mass": EFFECTS["mass"]})
        >>> specialist_tables(report)[0][2][0][:2]
        ['mass', 'relative change of the mass']
    """
    d, label = findings.details, findings.details.label
    causes = findings.causes
    alone = [s for s in d.singles if s.gain_nats > 0]
    return [
        (
            "Parameters, mean over all flights",
            ["cause", "parameter", "estimate", "90 %"],
            [
                [cause.label, p.label, f"{p.estimate:.4g}{p.unit_text}", p.interval.strip()]
                for cause in causes
                for p in cause.parameters.values()
            ],
            "llr",
        ),
        ("Where most of the difference lies", ["", "levels", "difference", "share"], _cells(findings), "llr"),
        (
            "Best sets of effects",
            ["set", "weight"],
            [[", ".join(map(label, s.effects)) or "none", percent(s.weight)] for s in d.subsets[:SETS_LISTED]],
            "lr",
        ),
        (
            "Each effect alone: evidence over none (ln)",
            ["effect", "gain", "remark"],
            [[label(s.effect), f"{s.gain_nats:.0f}", s.refused] for s in alone],
            "lrl",
        ),
        (
            "Flights and rows",
            ["", ""],
            [[n.replace("_", " "), f"{count:,}"] for n, count in findings.dropped.items()],
            "lr",
        ),
    ]


def by_level_table(findings: Findings) -> list[list[str]]:
    """Head and rows of costs in the thirds of the levels.

    Example:
        >>> from descentflow.diagnosis.diagnose import diagnose
        >>> from descentflow.effects import EFFECTS
        >>> by_level_table(diagnose("descents.parquet", "A320", catalogue={"mass": EFFECTS["mass"]}))[1][:2]
        ['time', 'FL150 to FL210']
    """
    rows = [["", "levels", "difference", *(["left"] if findings.causes else []), "by chance"]]
    for name in BY_LEVEL:
        for cost in [cost for cost in findings.costs if cost.name == name][1:]:
            after = ["-" if cost.after is None else between(cost.after, cost.unit)] if findings.causes else []
            place, floor = level_range(cost.low_fl, cost.high_fl), with_unit(cost.floor, cost.unit)
            rows.append([cost.label, place, between(cost.before, cost.unit), *after, floor])
    return rows


def _cells(findings: Findings) -> list[list[str]]:
    rows = []
    for cell in [cell for cell in findings.where if cell.share > 0][:CELLS_LISTED]:
        levels = (cell.level_low_fl, cell.level_high_fl)
        profile = findings.details.profile
        value = with_unit(*aviation_value(cell.quantity, cell.difference, *levels, profile), signed=True)
        rows.append([label_of(cell.quantity), level_range(*levels), value, percent(cell.share)])
    return rows
