"""The answer in words, for the terminal and the top of the page."""

from pathlib import Path

from descentflow.diagnosis.findings.cause_found import Cause
from descentflow.diagnosis.findings.findings import SEEN, SIGNIFICANT, Findings
from descentflow.diagnosis.findings.gap_found import BelowRounding, GapCell
from descentflow.diagnosis.findings.plain_values import percent
from descentflow.diagnosis.report.next_steps import next_steps
from descentflow.diagnosis.report.trade_units import in_trade, level_range, trade_number
from descentflow.diagnosis.report.words import (
    ALIKE,
    became,
    cause_words,
    cost_phrases,
    flights_name,
    how_sure,
    levels_of,
    shown_sizes,
    simulator_name,
    spoken,
    whole_costs,
)
from descentflow.measurements.quantity_registry import label_of

SPEEDS = ("cas_kt", "bias_kt")
"""Parameters of causes that are a matter of speed."""
SHOWN_SMALL = 3
"""Quantities reported for a gap that does not matter."""


def sentences(found: Findings) -> list[str]:
    """Difference and its cost, cause, and closure; and the number of flights that the simulator learnt from.

    Example:
        >>> from descentflow.diagnosis.diagnose import diagnose
        >>> from descentflow.effects import EFFECTS
        >>> report = diagnose("descents.parquet", "A320", catalogue={"mass": EFFECTS["mass"]})
        >>> sentences(report)[1].split("(")[0]
        'The cause is lighter aircraft '
    """
    if found.verdict == "none":
        rest = ": pass the simulator's own flights." if same_flights(found) else ", and nothing need be changed."
        return [_no_gap(found), f"{_alike(found)}.", f"No effect is named{rest}", *_lacks(found), *_seen(found)]
    closing = {"effect": _shrinks, "partial": _remains, "unknown": _unexplained}[found.verdict]
    return [f"{_differ(found)}: {_cost(found)}.", _why(found), closing(found), *_lacks(found), *_seen(found)]


def _lacks(found: Findings) -> list[str]:
    """Lacks of the simulator beside any cause: noise of reports, level-offs."""
    parts = []
    for lack in found.details.lacks:
        value, unit = in_trade(lack.quantity, lack.size, 0.0, 0.0, [])
        size = f"x {value:.2g}" if unit == "factor" else trade_number(value, unit, signed=True)
        parts.append(f"{label_of(lack.quantity)} ({size})")
    name = simulator_name(found)
    return [f"{name} lacks, beside any cause: {spoken(parts)}, real flights against its own."] if parts else []


def _seen(found: Findings) -> list[str]:
    """Number of the real flights that the simulator learnt from: on these it is not tested."""
    count, total = found.dropped.get(SEEN, 0), found.dropped.get("flights_given", 0)
    if not count:
        return []
    which = f"{count:,} of the {total:,} real flights are" if count < total else f"All {total:,} real flights are"
    return [
        f"{which} some that {simulator_name(found)} was trained or validated on, and are no test of it: pass others to "
        "learn how it descends beside flights that it has not seen."
    ]


def _p_value(found: Findings) -> str:
    return f"p = {found.p_value:.2g}"


def same_flights(found: Findings) -> bool:
    """Test for the very same flights on both sides.

    Example:
        >>> from descentflow.diagnosis.diagnose import diagnose
        >>> same_flights(diagnose("rows.parquet", "descents.parquet"))
        True
    """
    made = found.provenance
    if made is None or made.real.fingerprint is None:
        return False
    return made.real.fingerprint == made.simulator.fingerprint


def _no_gap(found: Findings) -> str:
    if same_flights(found):
        return (
            f"The flights of both sides are the same ({simulator_name(found)}): nothing can differ, and nothing is "
            "said of any simulator."
        )
    both = f"{simulator_name(found)} and the {flights_name(found)}"
    if found.is_small:
        rows = sorted(found.below_rounding, key=lambda row: -row.share)[:SHOWN_SMALL]
        most = [f"{label_of(row.quantity)} {small_difference(found, row)}" for row in rows]
        return (
            f"{both} differ measurably ({_p_value(found)}), but everywhere by less than the rounding of one flight's "
            f"reports leaves open (most: {spoken(most)})."
        )
    if found.p_value <= SIGNIFICANT:
        return f"{both} differ by more than chance would in all ({_p_value(found)}), but by less than what matters."
    return f"{both} differ by no more than chance would ({_p_value(found)})."


def small_difference(found: Findings, row: BelowRounding) -> str:
    """A difference that does not matter, beside what rounding leaves open, in units of the trade.

    Example:
        >>> from descentflow.diagnosis.diagnose import diagnose
        >>> from descentflow.effects import EFFECTS
        >>> report = diagnose("descents.parquet", "A320", catalogue={"mass": EFFECTS["mass"]})
        >>> small_difference(report, BelowRounding("cas", 150.0, 195.0, difference=0.11, rounding=0.29))
        '0.1 kt of 0.3 kt'
    """
    levels = (row.level_low_fl, row.level_high_fl)
    told = [in_trade(row.quantity, size, *levels, found.details.profile) for size in (row.difference, row.rounding)]
    return " of ".join(trade_number(*one) for one in told)


def _differ(found: Findings) -> str:
    if found.details.regime == "refit":
        return f"The {flights_name(found)} are as those of {simulator_name(found)} were, but not as it assumes"
    return f"{simulator_name(found)} and the {flights_name(found)} differ by more than chance ({_p_value(found)})"


def _cost(found: Findings) -> str:
    phrases = cost_phrases(whole_costs(found))
    levels = levels_of(found)
    if phrases:
        return f"{levels[:1].lower()}{levels[1:]} the real flights {spoken(phrases)}"
    if found.costs:
        return f"{_alike(found)[:1].lower()}{_alike(found)[1:]}, but what else is compared differs"
    return _place(found)


def _alike(found: Findings) -> str:
    """Costs that are alike on both sides, with the noise floor within which they are."""
    costs = whole_costs(found)
    within = [trade_number(costs[name].floor, costs[name].unit) for name in ALIKE if name in costs]
    if not within:
        return "What is compared is alike"
    return f"{levels_of(found)} both take, fly and descend alike, to within {spoken(within)}"


def _place(found: Findings) -> str:
    """Place of most of the gap."""
    cell = next((c for c in found.where if c.share > 0), None)
    if cell is None:
        return "no single level stands out"
    return f"most of it in the {label_of(cell.quantity)}, {level_range(cell.level_low_fl, cell.level_high_fl)}"


def _why(found: Findings) -> str:
    if not found.causes:
        return f"No effect of the catalogue explains it, alone or with others ({_place(found)})."
    label = found.details.label
    which = {cause.effect: cause.label if len(found.causes) > 1 else "it" for cause in found.causes}
    alike = [f"{which[c.effect]} from {spoken([label(name) for name in c.group])}" for c in found.causes if c.group]
    doubt = f", though these data cannot tell {spoken(alike)}" if alike else ""
    begin = "The cause is" if len(found.causes) == 1 else "The causes are"
    if found.verdict == "partial":
        begin = "One cause is" if len(found.causes) == 1 else "Causes are"
    noise = any("reports have none" in size.text for cause in found.causes for size in cause.sizes)
    no_fault = " Reports without noise are no fault of the flights that they tell." if noise else ""
    return f"{begin} {spoken([cause_words(cause) for cause in found.causes])}{doubt}.{no_fault}"


def _them(found: Findings) -> str:
    return "it" if len(found.causes) == 1 else "them"


def _shrunk(found: Findings) -> str:
    """Costs with the causes, or the closed share where nothing costs anything."""
    costs = whole_costs(found)
    # Where no cause is one of speed, how fast crews happen to fly would hide what the causes do.
    speed = any(p in SPEEDS for cause in found.causes for p in cause.parameters)
    sure = [name for name, cost in costs.items() if cost.before.excludes_zero and cost.after is not None]
    told = [name for name in sure if name in (("time", "cas") if speed else ("time_at_speed",))]
    if "time" not in told and "time_at_speed" in sure and "time_at_speed" not in told:
        # The time itself is not known to differ, and what it costs is told at equal speed above.
        told.append("time_at_speed")
    told = [*_cell_became(found), *(became(costs[name]) for name in told)]
    share = found.causes[0].closure.marginal.estimate if found.causes else None
    closed = "" if share is None else f"{percent(share)} of the gap in all that is compared is closed"
    return "; ".join(part for part in (*told, closed) if part)


def _cell_became(found: Findings) -> list[str]:
    """Change of the difference that is the largest share of the gap."""
    cells = [c for c in found.where if c.share > 0 and c.regime != "all" and c.quantity in found.details.curves]
    return next((told for told in (_one_cell(found, cell) for cell in cells) if told), [])


def _one_cell(found: Findings, cell: GapCell) -> list[str]:
    curve = found.details.curves[cell.quantity]
    inside = [
        k for k, fl in enumerate(curve.level_fl) if fl is not None and cell.level_low_fl <= fl <= cell.level_high_fl
    ]
    if not inside:
        return []
    means = (sum(values[k] for k in inside) / len(inside) for values in (curve.before, curve.after))
    levels = (cell.level_low_fl, cell.level_high_fl)
    before, now = (
        trade_number(*in_trade(cell.quantity, mean, *levels, found.details.profile), signed=True) for mean in means
    )
    if before == now:
        # What no cause moves: of it nothing can be said.
        return []
    return [f"the {label_of(cell.quantity)} ({level_range(*levels)}) goes from {before} to {now}"]


def _shrinks(found: Findings) -> str:
    return f"With {_them(found)} in the simulator {_shrunk(found) or 'nothing can be measured to close'}."


def _remains(found: Findings) -> str:
    left = f"what is left is a gap of no named cause ({_left(found)})"
    return f"With {_them(found)} in the simulator {_shrunk(found)}; {left}."


def _unexplained(found: Findings) -> str:
    where = "outside the catalogue, or is one that these flights do not tell"
    return f"Its cause lies {where}; most stands out in {_left(found)}."


def _left(found: Findings) -> str:
    """The largest difference that is left, in units of the trade."""
    left = found.remaining.largest
    value, unit = in_trade(left.quantity, left.difference, left.level_low_fl, left.level_high_fl, found.details.profile)
    place = level_range(left.level_low_fl, left.level_high_fl)
    return f"the {label_of(left.quantity)}, {trade_number(value, unit, signed=True)}, {place}"


def summary(found: Findings, folder: Path | None = None) -> str:
    """For a terminal.

    Args:
        found: What the diagnosis found.
        folder: Where the report was written, so that commands can be run from where the reader is.

    Example:
        >>> from descentflow.diagnosis.diagnose import diagnose
        >>> from descentflow.effects import EFFECTS
        >>> report = diagnose("descents.parquet", "A320", catalogue={"mass": EFFECTS["mass"]})
        >>> print(summary(report))
        nominal BADA of the A320 and the 120 real A320 flights differ by more than chance (p = ...
        The cause is lighter aircraft (mass x 0.9...
        With it in the simulator ...
          mass: mass x 0.9... (0.8... to 0.9...)
            how sure: ...
            closes alone: ...
        What to do next:
          ...
    """
    lines = sentences(found)
    for cause in found.causes:
        lines += _cause_lines(found, cause)
    lines += [] if found.previous is None else [found.previous.text]
    used = None if found.provenance is None else found.provenance.coefficients
    if used is not None and used.stand_in:
        lines.append(str(used))
    lines += [f"{channel}." for channel in found.left_out_channels]
    steps = next_steps(found, folder)
    if steps:
        lines += ["What to do next:", *(f"  - {step}" for step in steps)]
    return "\n".join(lines)


def _cause_lines(found: Findings, cause: Cause) -> list[str]:
    sizes = [*(size.text for size in shown_sizes(cause)), cause.in_flights(whole=True)]
    lines = [f"  {cause.label}: {'; '.join(filter(None, sizes))}", f"    how sure: {how_sure(cause)}"]
    if cause.group:
        lines.append(f"    could as well be: {', '.join(found.details.label(name) for name in cause.group)}")
    if cause.own_closure is not None:
        lines.append(f"    closes alone: {cause.own_closure} of the gap")
    return lines
