"""The page's section on what the gap costs."""

from collections.abc import Sequence

from descentflow.diagnosis.findings.costs_found import Cost, Measured
from descentflow.diagnosis.findings.findings import Findings
from descentflow.diagnosis.report.trade_units import level_range, trade_number
from descentflow.diagnosis.report.words import (
    flights_name,
    simulator_name,
    tells_a_slope_of_wind,
    whole_costs,
)
from descentflow.reporting.html_elements import Html, details, paragraph, stacked_table
from descentflow.reporting.svg_figures import drawn_for_both


def cost_section(found: Findings) -> list[Html]:
    """Section on the costs of the gap over all levels, drawn and as a table, and by level.

    Example:
        >>> from descentflow.diagnosis.diagnose import diagnose
        >>> from descentflow.effects import EFFECTS
        >>> report = diagnose("descents.parquet", "A320", catalogue={"mass": EFFECTS["mass"]})
        >>> [part[:8] for part in cost_section(report)]
        ['<p>Means', '<figure>', '<div cla', '<details']
    """
    from descentflow.diagnosis.report.gap_figures import costs_figure  # matplotlib loads where figures are drawn

    if not found.costs:
        return [paragraph("No rate of descent is compared, so nothing is known of times and distances.")]
    whole = whole_costs(found)
    rest = [cost for cost in found.costs if cost not in whole.values()]
    lead = (
        f"Means of the {flights_name(found)} minus those of {simulator_name(found)}. The noise floor is what nine of "
        "ten pairs of fleets of this size stay below that differ by chance alone."
    )
    if found.causes:
        lead += (
            " With the causes: they are put into the simulator's flights. How fast crews fly and how heavy aircraft "
            "are differs between fleets by more than most causes do, and is left in these numbers. Where a cause is "
            "no matter of speed, judge it by the time at equal speed."
        )
    if "ground_distance" in whole and any(tells_a_slope_of_wind(one) for one in found.causes):
        lead += (
            " Of a wind that changes with altitude the change is the cause, about each flight's mean wind: by how much "
            "the mean wind itself differs is left in the distance over ground."
        )
    parts = [
        paragraph(lead),
        drawn_for_both(lambda narrow: costs_figure(found.costs, narrow=narrow), "costs", costs_in_words(found)),
        _table(found, list(whole.values())),
    ]
    return [*parts, details("By level", _table(found, rest, levels=True))] if rest else parts


def costs_in_words(found: Findings) -> str:
    """Description of the figure of costs, for readers who do not see it.

    Example:
        >>> from descentflow.diagnosis.diagnose import diagnose
        >>> from descentflow.effects import EFFECTS
        >>> costs_in_words(diagnose("descents.parquet", "A320", catalogue={"mass": EFFECTS["mass"]}))[:40]
        'Real flights minus simulator, FL150 to F'
    """
    told = []
    for cost in whole_costs(found).values():
        before = trade_number(cost.before.estimate, cost.unit, signed=True)
        after = "" if cost.after is None else f", {trade_number(cost.after.estimate, cost.unit, signed=True)} after"
        told.append(f"{cost.label} {before} before{after} (noise floor {trade_number(cost.floor, cost.unit)})")
    levels = level_range(found.costs[0].low_fl, found.costs[0].high_fl)
    return f"Real flights minus simulator, {levels}: {'; '.join(told)}."


def _table(found: Findings, costs: Sequence[Cost], *, levels: bool = False) -> Html:
    corrected = any(cost.after is not None for cost in costs)
    head = ["", "simulator", "real flights", "difference (90 %)"]
    head += ["with the causes (90 %)"] if corrected else []
    rows = []
    for cost in sorted(costs, key=lambda c: -c.high_fl) if levels else costs:
        name = f"{cost.label}, {level_range(cost.low_fl, cost.high_fl)}" if levels else cost.label
        row = [name, trade_number(cost.simulator, cost.unit), trade_number(cost.flights, cost.unit)]
        row.append(with_interval(cost.before, cost.unit))
        row += ["-" if cost.after is None else with_interval(cost.after, cost.unit)] if corrected else []
        rows.append([*row, trade_number(cost.floor, cost.unit)])
    caption = "" if levels else level_range(costs[0].low_fl, costs[0].high_fl) if costs else ""
    return stacked_table([*head, "noise floor"], rows, caption=caption)


def with_interval(value: Measured, unit: str) -> str:
    """A difference with its sign and its interval.

    Example:
        >>> with_interval(Measured(25.0, 22.0, 28.0), "s")
        '+25 s (+22 to +28)'
    """
    text = trade_number(value.estimate, unit, signed=True)
    if value.low is None or value.high is None:
        return text
    low, high = (trade_number(x, unit, signed=True).removesuffix(f" {unit}") for x in (value.low, value.high))
    return f"{text} ({low} to {high})"
