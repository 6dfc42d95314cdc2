"""The page and the terminal text of a diagnosis: its findings as short numbers for the templates next to this file."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from shlex import quote
from typing import Any

from descentflow.diagnosis.findings._sizes import reported_text
from descentflow.diagnosis.findings.aviation_units import at_level, aviation_value, between, level_range, with_unit
from descentflow.diagnosis.findings.cause_found import Cause
from descentflow.diagnosis.findings.costs_found import CLOSED, Cost, Measured, judged
from descentflow.diagnosis.findings.findings import SEEN, Curve, DetectionLimit, Findings
from descentflow.diagnosis.findings.gap_found import FALSE_GAP
from descentflow.diagnosis.findings.inputs_found import InputUsed, Provenance
from descentflow.diagnosis.findings.plain_values import percent
from descentflow.diagnosis.report.page_tables import (
    by_level_table,
    cost_table,
    inputs_table,
    shown_costs,
    specialist_tables,
    whole_costs,
)
from descentflow.effects import EFFECTS, UNKNOWN
from descentflow.effects.effect import NONE
from descentflow.measurements.quantity_registry import label_of
from descentflow.reporting.pages import drawing, rendered

COSTS_DRAWN = ("time", "time_at_speed", "ground_distance", "air_distance", "rate")
"""Costs that are drawn by level."""
BRIEF = ("time", "ground_distance", "air_distance", "rate")
"""Costs at the top of the page."""
LEVELS_DRAWN = 4
"""Quantities drawn against altitude: the rate, and those that differ most in standard errors."""


def page(findings: Findings, folder: str | Path = "gap") -> str:
    """The whole page, figures inside.

    Args:
        findings: What the diagnosis found.
        folder: Where the report is written, for the command to type next.

    Example:
        >>> from descentflow.diagnosis.diagnose import diagnose
        >>> from descentflow.effects import EFFECTS, UNKNOWN
        >>> report = diagnose("descents.parquet", "A320", catalogue={"mass": EFFECTS["mass"]})
        >>> page(report).count("<h2")  # sections
        6
    """
    from descentflow.diagnosis.report import figures  # matplotlib loads where figures are drawn

    drawn = [cost for cost in shown_costs(findings) if cost.name in COSTS_DRAWN]
    curves = {name: findings.details.curves[name] for name in _levels_drawn(findings.details.curves)}
    has_after, profile = bool(findings.causes), findings.details.profile
    cause, made = findings.details.label, findings.provenance
    return rendered(
        "diagnosis/report/gap.html.j2",
        **_shared(findings),
        written=True,
        command=next_command(findings, folder),
        costs=cost_table(findings, means=True),
        cost_figures=[
            (
                f"{cost.label} by levels, of all {between(cost.before, cost.unit)}",
                drawing(figures.cost_figure(findings.costs, cost.name)),
            )
            for cost in drawn
        ],
        level_figures=[
            (_level_alt(findings, name, curve), drawing(figures.level_figure(name, curve, profile, after=has_after)))
            for name, curve in curves.items()
        ],
        changes=[[cause(s.effect), s.text, c.text] for s, c in zip(findings.recipe, findings.causes, strict=True)],
        small=[
            [label_of(row.quantity), level_range(*ends), *(_in_words(findings, row.quantity, x, *ends) for x in sizes)]
            for row in findings.below_rounding
            for ends, sizes in [((row.level_low_fl, row.level_high_fl), (row.difference, row.rounding))]
        ],
        brief=_brief(findings),
        inputs=inputs_table(findings),
        by_level=by_level_table(findings),
        numbers=specialist_tables(findings),
        settings=[*made.versions.items(), *made.settings.items(), *made.real.settings.items()],
    )


def summary(findings: Findings, command: str = "", *, written: bool = True) -> str:
    """The answer for a terminal.

    Args:
        findings: What the diagnosis found.
        command: To type next; as :func:`next_command` has it if absent.
        written: Whether its files are in a folder.

    Example:
        >>> from descentflow.diagnosis.diagnose import diagnose
        >>> from descentflow.effects import EFFECTS, UNKNOWN
        >>> report = diagnose("descents.parquet", "A320", catalogue={"mass": EFFECTS["mass"]})
        >>> print(summary(report))
        Nominal BADA of the A320 and the 120 real A320 flights differ (p = ...): one cause explains it.
        ...
        Change in nominal BADA of the A320:
          mass: mass x 0.9... (0.8... to 0.9...), FL150 to FL...
        ...
    """
    command = command or next_command(findings)
    costs = _aligned(cost_table(findings)) if findings.costs else ""
    made = {"costs": costs, "command": command, "written": written}
    return rendered("diagnosis/report/gap.txt.j2", **_shared(findings), **made).strip()


def simulator_name(findings: Findings) -> str:
    """The simulator by the name that its owner gave it; never a file's.

    Example:
        >>> from descentflow.diagnosis.diagnose import diagnose
        >>> from descentflow.effects import EFFECTS, UNKNOWN
        >>> simulator_name(diagnose("descents.parquet", "A320", catalogue={"mass": EFFECTS["mass"]}))
        'nominal BADA of the A320'
    """
    name, made = findings.details.simulator, findings.provenance
    if name == "nominal":
        return f"nominal BADA of the {findings.details.typecode}"
    return "the simulator" if made.simulator.name in ("", name) else name


def _brief(findings: Findings) -> list[tuple[str, str]]:
    """Time, distance and rate of the whole, and what each cause takes away of them."""
    costs = [cost for cost in shown_costs(findings) if cost.name in BRIEF]

    def numbers(sizes: Sequence[float]) -> str:
        pairs = zip(sizes, costs, strict=True)
        return ", ".join(with_unit(size, cost.unit, signed=True) for size, cost in pairs)

    if not costs:
        return []
    rows = [(f"Real flights minus {simulator_name(findings)}", numbers([cost.before.estimate for cost in costs]))]
    for cause in [cause for cause in findings.causes if cause.takes_away]:
        text = f"{cause.label or cause.effect} takes away"
        rows.append((text[:1].upper() + text[1:], numbers([cause.takes_away.get(cost.name, 0.0) for cost in costs])))
    return rows


def next_command(findings: Findings, folder: str | Path = "gap", real: str = "", simulator: str = "") -> str:
    """The command to type next; empty where nothing is left to do.

    Args:
        findings: What the diagnosis found.
        folder: Where its report lies; next to the reader if absent.
        real: The real flights as they are typed; their name if empty.
        simulator: The simulator in the same way.

    Example:
        >>> from descentflow.diagnosis.diagnose import diagnose
        >>> from descentflow.effects import EFFECTS, UNKNOWN
        >>> next_command(diagnose("descents.parquet", "A320", catalogue={"mass": EFFECTS["mass"]}), "gap")
        'descentflow diagnose --real descents.parquet --simulator FLOWN_AGAIN --previous gap/gap.json --out gap-next'
    """
    made = findings.provenance
    if not made.real.flights or findings.verdict == "none":
        return ""
    place = Path(folder)
    if findings.corrected_file.endswith(".ckpt"):
        return f"descentflow sample {quote(str(place / findings.corrected_file))} -n 1000 --out samples.parquet"
    folder = f" --bada-dir {quote(made.settings['bada_dir'])}" if "bada_dir" in made.settings else ""
    again = f"descentflow diagnose --real {real or _typed(made.real)}{folder}"
    out = quote(f"{place}-next")
    if findings.causes:
        # Flights have a designator, which may be that of several models.
        again += f" --typecode {quote(_bada4_model(made))}" if _bada4_model(made) else ""
        return f"{again} --simulator FLOWN_AGAIN --previous {quote(str(place / 'gap.json'))} --out {out}"
    simulator = simulator or f"--simulator {_typed(made.simulator)}"
    return f"{again} {simulator} --catalogue MY_EFFECTS.py --out {out}"


def repair_command(findings: Findings) -> str:
    """The command that mends coefficients where polar, mass or idle thrust is a cause; empty elsewhere.

    Example:
        >>> from descentflow.diagnosis.diagnose import diagnose
        >>> from descentflow.effects import EFFECTS
        >>> repair_command(diagnose("descents.parquet", "A320", catalogue={"mass": EFFECTS["mass"]}))
        'descentflow repair descents.parquet --aircraft A320 --out A320.toml'
    """
    made = findings.provenance
    of_coefficients = any(one.effect in EFFECTS and EFFECTS[one.effect].of_coefficients for one in findings.causes)
    if made is None or findings.corrected_file.endswith(".ckpt") or not of_coefficients:
        return ""
    model = _bada4_model(made)
    code = quote(model or findings.details.typecode)
    licensed = "coefficients" in made.settings
    folder = f" --bada-dir {quote(made.settings.get('bada_dir', 'BADA'))}" if licensed else ""
    ending = "html" if model else "toml"
    return f"descentflow repair {_typed(made.real)} --aircraft {code}{folder} --out {code}.{ending}"


def _bada4_model(made: Provenance) -> str:
    """Name of the model of BADA 4 whose coefficients were used; empty for others."""
    licence, _, model = made.settings.get("coefficients", "").partition(" file ")
    return model if licence.startswith("BADA 4") else ""


def _typed(used: InputUsed) -> str:
    """One file by its name, anything else by a word to be replaced."""
    return quote(used.name) if "." in used.name and " + " not in used.name else "FLIGHTS"


def _shared(findings: Findings) -> dict[str, Any]:
    """Values and macros of both templates."""
    name, made, whole = simulator_name(findings), findings.provenance, whole_costs(findings)
    used = made.coefficients
    counted = findings.dropped.get("flights_compared")
    types = listed(used.of_flights) if used and used.of_flights else findings.details.typecode
    return {
        "findings": findings,
        "name": name,
        "Name": name[:1].upper() + name[1:],
        "flights": f"{'' if counted is None else f'{counted:,} '}real {types} flights",
        "whole_range": f"FL{whole[0].high_fl:.0f} down to FL{whole[0].low_fl:.0f}" if whole else "",
        "p": f"{findings.p_value:.2g}",
        "significant": FALSE_GAP,
        "same": bool(made.real.fingerprint) and made.real.fingerprint == made.simulator.fingerprint,
        "left_of": [cost for cost in judged(findings.costs) if cost.after],
        "perhaps": listed([f"{between(c.before, c.unit)} in {c.label}" for c in whole if _may_differ(c)]),
        "known_flights": findings.dropped.get(SEEN, 0),
        "standing": _standing(findings),
        "stand_in": str(used) if used and used.stand_in else "",
        "airs_of_simulator": [_air_of_simulator(cause) for cause in findings.causes if not cause.inherited],
        "decide": _deciding(findings),
        "repair": repair_command(findings),
        "worth_a_look": findings.flights_worth_a_look if findings.verdict in ("unknown", "partial") else [],
        "limits": _limits(findings),
        "then_named": listed([*map(findings.details.label, findings.previous.causes)]) if findings.previous else "",
        "percent": percent,
        "number": with_unit,
        "levels": level_range,
        "label": label_of,
        "listed": listed,
        "shown": lambda *one: _in_words(findings, *one),
    }


def _may_differ(cost: Cost) -> bool:
    """Test for a cost that no speed of crews moves, and that is more than nine of ten differences by chance."""
    return cost.name in CLOSED and cost.before.excludes_zero and abs(cost.before.estimate) > cost.floor


def listed(parts: Sequence[str], word: str = "and") -> str:
    """A list in words.

    Example:
        >>> listed(["a", "b", "c"]), listed(["a"])
        ('a, b and c', 'a')
    """
    return f" {word} ".join([*([", ".join(parts[:-1])] if parts[1:] else []), *parts[-1:]])


def limit_text(limit: DetectionLimit) -> str:
    """The smallest size of an effect that would be named.

    Example:
        >>> limit_text(DetectionLimit("temperature", "deviation_k", 1.2, "K"))
        'ISA +1.2 K'
        >>> limit_text(DetectionLimit("mass", "relative_change", 0.03, "1"))
        'mass x 1.03'
        >>> limit_text(DetectionLimit("of_your_own", "drag", 1.07, "factor", "drag at high Mach numbers"))
        'drag at high Mach numbers x 1.07'
    """
    size = limit.size or 0.0
    for parameter in EFFECTS[limit.effect].parameters if limit.effect in EFFECTS else ():
        if parameter.name == limit.parameter:
            shown = parameter.reported(size)
            # A third digit says nothing of a chance.
            brief = shown if parameter.reported_unit == "factor" else float(f"{shown:.2g}")
            return reported_text(parameter, Measured(brief))
    return f"{limit.label or limit.parameter.replace('_', ' ')} {with_unit(size, limit.unit)}"


def _limits(findings: Findings) -> list[list[str]]:
    """Sizes that would be found; none of the air where a weather field made airspeeds, for its own error is larger."""
    sides = findings.provenance or Provenance()
    by_field = sides.real.derived or sides.simulator.derived
    air = {name for name, effect in EFFECTS.items() if effect.of_air and by_field}
    limits = [limit for limit in findings.details.detection_limits if limit.size and limit.effect not in air]
    return [[findings.details.label(limit.effect), limit_text(limit)] for limit in limits]


def _deciding(findings: Findings) -> list[tuple[str, str, str]]:
    """Effects that look alike, the channels that would separate them, and why no channel would."""
    rows = [
        (listed([findings.details.label(name) for name in row.between if name != UNKNOWN]), row.channels, row.why)
        for row in findings.would_split
    ]
    for channel in findings.left_out_channels:
        names = [findings.details.label(name) for name in channel.would_separate]
        if names:
            rows.append((f"{names[0]} from its likes" if len(names) == 1 else listed(names), [channel.channel], ""))
    return list(dict.fromkeys((names, listed(channels, "or"), why) for names, channels, why in rows))


def _standing(findings: Findings) -> float | None:
    """The largest difference that is left, in standard errors; None where it is of several bands."""
    left = findings.remaining.largest
    curve = findings.details.curves.get(left.quantity, Curve([], [], [], []))
    pairs = zip(curve.level_fl, curve.error, strict=True)
    errors = [error for fl, error in pairs if fl is None or left.level_low_fl <= fl <= left.level_high_fl]
    return abs(left.difference) / errors[0] if len(errors) == 1 and errors[0] > 0.0 else None


def _in_words(findings: Findings, quantity: str, value: float, low_fl: float, high_fl: float) -> str:
    """A difference with sign and unit; of noise its factor."""
    return with_unit(*aviation_value(quantity, value, low_fl, high_fl, findings.details.profile), signed=True)


def _aligned(rows: Sequence[Sequence[str]]) -> str:
    """A table for a terminal: names on the left, numbers on the right."""
    wide = [max(len(cell) for cell in column) for column in zip(*rows, strict=True)]
    lines = [
        "  ".join([row[0].ljust(wide[0]), *(cell.rjust(n) for cell, n in zip(row[1:], wide[1:], strict=True))])
        for row in rows
    ]
    return "\n".join(f"  {line}".rstrip() for line in lines)


def _air_of_simulator(cause: Cause) -> str:
    """Air of the simulator's flights where the air is a cause: ``unknown``, ``standard``, or its ``own``."""
    effect = EFFECTS.get(cause.effect)
    if effect is None or not effect.is_temperature:
        return ""
    if not cause.on_both_sides:
        return "unknown"
    return "own" if abs(cause.on_both_sides[0].simulator) >= NONE * effect.parameters[0].scale else "standard"


def _levels_drawn(curves: Mapping[str, Curve]) -> list[str]:
    """Quantities of bands with the largest differences in standard errors, the rate first."""
    banded = [name for name, curve in curves.items() if curve.level_fl[0] is not None]
    size = {
        name: max(abs(b / e) for b, e in zip(curves[name].before, curves[name].error, strict=True)) for name in banded
    }
    return sorted(banded, key=lambda name: (name != "rate", -size[name]))[:LEVELS_DRAWN]


def _level_alt(findings: Findings, name: str, curve: Curve) -> str:
    """Description of a figure by level."""
    texts = []
    for when, values in (("now", curve.before), ("with the causes", curve.after))[: 2 if findings.causes else 1]:
        k = max(range(len(values)), key=lambda i: abs(values[i]))
        fl = curve.level_fl[k] or 0.0
        value = with_unit(*aviation_value(name, values[k], fl, fl, at_level(findings.details.profile, fl)), signed=True)
        texts.append(f"{when} {value} at FL{fl:.0f}")
    return f"Largest difference of {label_of(name)}: {', '.join(texts)}."
