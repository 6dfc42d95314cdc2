"""Names and phrases that the page and the terminal share: the simulator by name, what the gap costs, how sure."""

from collections.abc import Sequence

from descentflow.diagnosis.findings.cause_found import Cause, TradeSize
from descentflow.diagnosis.findings.costs_found import Cost, Measured
from descentflow.diagnosis.findings.findings import Findings
from descentflow.diagnosis.findings.plain_values import percent
from descentflow.diagnosis.findings.selection_found import DetectionLimit
from descentflow.diagnosis.report.sizes import told_text
from descentflow.diagnosis.report.trade_units import level_range, trade_number
from descentflow.effects import EFFECTS, Parameter

PHRASES = {
    "time": ("take {} longer", "take {} less"),
    "ground_distance": ("fly {} further over ground", "fly {} less far over ground"),
    "air_distance": ("fly {} further through the air", "fly {} less far through the air"),
    "rate": ("descend {} faster", "descend {} more slowly"),
    "time_at_speed": ("take {} longer at equal speed", "take {} less at equal speed"),
    "cas": ("fly {} faster (CAS)", "fly {} slower (CAS)"),
    "tas": ("fly {} faster (TAS)", "fly {} slower (TAS)"),
    "level": ("lose {} more in level-offs", "lose {} less in level-offs"),
    "slow": ("lose {} more in slow stretches", "lose {} less in slow stretches"),
}
"""Cost -> what real flights do where their mean is above the simulator's, and where it is below."""
WIND_SLOPE = "kt per 1,000 ft"
"""Unit of a wind that changes with altitude."""
MOST = 3
"""Phrases at the top: who wants more finds the table."""
ALIKE = ("time", "air_distance", "rate")
"""Costs by which a gap that costs nothing is described."""


def simulator_name(found: Findings) -> str:
    """The simulator by name.

    Example:
        >>> from descentflow.diagnosis.diagnose import diagnose
        >>> from descentflow.effects import EFFECTS
        >>> simulator_name(diagnose("descents.parquet", "A320", catalogue={"mass": EFFECTS["mass"]}))
        'nominal BADA of the A320'
    """
    name = found.details.simulator
    return f"nominal BADA of the {found.details.typecode}" if name == "nominal" else name


def flights_name(found: Findings) -> str:
    """The real flights, with how many they are.

    Example:
        >>> from descentflow.diagnosis.diagnose import diagnose
        >>> from descentflow.effects import EFFECTS
        >>> flights_name(diagnose("descents.parquet", "A320", catalogue={"mass": EFFECTS["mass"]}))
        '120 real A320 flights'
    """
    count = found.dropped.get("flights_compared")
    used = None if found.provenance is None else found.provenance.coefficients
    # Another type's coefficients may stand for theirs.
    types = found.details.typecode if used is None or not used.of_flights else spoken(used.of_flights)
    return f"{'' if count is None else f'{count:,} '}real {types} flights"


def whole_costs(found: Findings) -> dict[str, Cost]:
    """Costs over all levels, by name.

    Example:
        >>> from descentflow.diagnosis.diagnose import diagnose
        >>> from descentflow.effects import EFFECTS
        >>> report = diagnose("descents.parquet", "A320", catalogue={"mass": EFFECTS["mass"]})
        >>> whole_costs(report)["time"].unit
        's'
    """
    first = found.costs[0] if found.costs else None
    return {c.name: c for c in found.costs if first and (c.low_fl, c.high_fl) == (first.low_fl, first.high_fl)}


def cost_phrases(costs: dict[str, Cost]) -> list[str]:
    """Differences of real flights from the simulator that are more than chance: the surest three.

    Example:
        >>> time = Cost("time", "time", "s", 150.0, 370.0, 520.0, 545.0, Measured(25.0, 22.0, 28.0), None, 3.0)
        >>> cost_phrases({"time": time})
        ['take 25 s (22 to 28) longer']
    """
    known = {n: c for n, c in costs.items() if n in PHRASES and c.before.excludes_zero}
    if "ground_distance" in costs:
        known.pop("air_distance", None)
    surest = sorted(known, key=lambda name: -abs(known[name].before.estimate) / max(known[name].floor, 1e-9))[:MOST]
    found = []
    for name, (more, less) in PHRASES.items():
        if name in surest:
            phrase = more if known[name].before.estimate > 0 else less
            found.append(phrase.format(sized(known[name].before, known[name].unit)))
    return found


def sized(value: Measured, unit: str) -> str:
    """The size of a difference without its sign, and its interval.

    Example:
        >>> sized(Measured(-112.0, -120.0, -104.0), "ft/min")
        '112 ft/min (104 to 120)'
    """
    if value.low is None or value.high is None:
        return trade_number(abs(value.estimate), unit)
    ends = sorted((abs(value.low), abs(value.high))) if value.excludes_zero else [value.low, value.high]
    low, high = (trade_number(x, unit).removesuffix(f" {unit}") for x in ends)
    return f"{trade_number(abs(value.estimate), unit)} ({low} to {high})"


def spoken(parts: Sequence[str]) -> str:
    """A list as it is spoken.

    Example:
        >>> spoken(["a", "b", "c"]), spoken(["a"])
        ('a, b and c', 'a')
    """
    return ", ".join(parts[:-1]) + " and " + parts[-1] if len(parts) > 1 else "".join(parts)


def cause_words(cause: Cause) -> str:
    """A cause with its size in units of the trade and the flights that have it.

    Example:
        >>> from descentflow.diagnosis.diagnose import diagnose
        >>> from descentflow.effects import EFFECTS
        >>> cause_words(diagnose("descents.parquet", "A320", catalogue={"mass": EFFECTS["mass"]}).causes[0])
        'lighter aircraft (mass x 0.9...)'
    """
    size = size_words(cause)
    return f"{cause.text} ({size})" if size else cause.text


def shown_sizes(cause: Cause) -> list[TradeSize]:
    """Reported sizes: but what an effect does to reports of itself where it does nothing to them.

    Example:
        >>> from descentflow.diagnosis.diagnose import diagnose
        >>> from descentflow.effects import EFFECTS
        >>> report = diagnose("descents.parquet", "A320", catalogue={"mass": EFFECTS["mass"]})
        >>> [size.unit for size in shown_sizes(report.causes[0])]
        ['factor']
    """
    known = EFFECTS[cause.effect].parameters if cause.effect in EFFECTS else ()
    own = {p.name: p for p in known if p.by_product}
    return [size for size in cause.sizes if size.parameter not in own or size.short != _of_none(own[size.parameter])]


def _of_none(parameter: Parameter) -> str:
    """Words for a parameter where the effect does nothing to it."""
    return told_text(parameter, Measured(parameter.told(0.0)))


def size_words(cause: Cause) -> str:
    """The size of a cause: its first number, the levels between which it is, and the share of the flights.

    Example:
        >>> from descentflow.diagnosis.diagnose import diagnose
        >>> from descentflow.effects import EFFECTS
        >>> size_words(diagnose("descents.parquet", "A320", catalogue={"mass": EFFECTS["mass"]}).causes[0])
        'mass x 0.9...'
    """
    levels = [f"FL{size.value.estimate:.0f}" for size in cause.sizes if size.unit == "FL"]
    others = [size.short for size in cause.sizes if size.unit != "FL"]
    parts = others[:1]
    if len(levels) == 2:
        parts.append(f"between {levels[0]} and {levels[1]}")
    return " ".join([*parts, cause.in_flights()]).strip()


def tells_a_slope_of_wind(cause: Cause) -> bool:
    """Test for a size of the cause that is a change of the wind with altitude, which leaves the mean wind open.

    Example:
        >>> from descentflow.diagnosis.diagnose import diagnose
        >>> from descentflow.effects import EFFECTS
        >>> tells_a_slope_of_wind(diagnose("descents.parquet", "A320", catalogue={"mass": EFFECTS["mass"]}).causes[0])
        False
    """
    return any(size.unit == WIND_SLOPE for size in cause.sizes)


def limit_words(limit: DetectionLimit) -> str:
    """The smallest size of an effect that would be named, as its size is reported where it is named.

    Example:
        >>> limit_words(DetectionLimit("temperature", "deviation_k", 1.2, "K"))
        'ISA +1.2 K'
        >>> limit_words(DetectionLimit("turn", "extra_cd2", None, "factor"))
        'none that is possible'
        >>> limit_words(DetectionLimit("of_your_own", "drag", 1.07, "factor", "drag at high Mach numbers"))
        'drag at high Mach numbers x 1.07'
    """
    if limit.size is None:
        return "none that is possible"
    parameter = _parameter_of(limit)
    if parameter is not None:
        return told_text(parameter, Measured(limit.size))
    return f"{limit.label or limit.parameter.replace('_', ' ')} {trade_number(limit.size, limit.unit)}"


def limit_flights(limit: DetectionLimit) -> str:
    """Flights that have an effect of the smallest size that would be named.

    Example:
        >>> limit_flights(DetectionLimit("speed_brake", "extra_cd0", 1.1, "factor", share=0.61))
        '61 % of them'
        >>> limit_flights(DetectionLimit("temperature", "deviation_k", 1.2, "K"))
        'all'
        >>> limit_flights(DetectionLimit("geometric_path", "share", 6.0, "%"))  # its size says it
        '-'
    """
    parameter = _parameter_of(limit)
    if limit.size is None or (parameter is not None and parameter.shown_as == "flights"):
        return "-"
    return "all" if limit.share is None else f"{percent(limit.share)} of them"


def _parameter_of(limit: DetectionLimit) -> Parameter | None:
    """The parameter that a limit is of; None of an effect of the user's own."""
    known = EFFECTS[limit.effect].parameters if limit.effect in EFFECTS else ()
    return next((p for p in known if p.name == limit.parameter), None)


def how_sure(cause: Cause) -> str:
    """Certainty of the cause in words.

    Example:
        >>> from descentflow.diagnosis.diagnose import diagnose
        >>> from descentflow.effects import EFFECTS
        >>> how_sure(diagnose("descents.parquet", "A320", catalogue={"mass": EFFECTS["mass"]}).causes[0])
        'is a cause with a probability of 98 %'
    """
    if cause.inclusion is None:
        return f"explains best in {100 * cause.probability:.0f} of 100 fleets drawn from these aircraft"
    either = f"is a cause with a probability of {percent(cause.inclusion)}"
    if percent(cause.inclusion) == percent(cause.probability):
        return either
    return f"or one that looks like it {either}; it itself with {percent(cause.probability)}"


def became(cost: Cost) -> str:
    """A cost before and after, in words.

    Example:
        >>> after = Measured(1.5, -1.0, 4.0)
        >>> became(Cost("time", "time", "s", 150.0, 370.0, 520.0, 545.0, Measured(25.0, 22.0, 28.0), after, 3.0))
        '25 s of time become 1.5 s (noise floor 3.0 s)'
    """
    after = cost.after.estimate if cost.after is not None else cost.before.estimate
    before, now = (trade_number(abs(x), cost.unit) for x in (cost.before.estimate, after))
    return f"{before} of {cost.label} become {now} (noise floor {trade_number(cost.floor, cost.unit)})"


def levels_of(found: Findings) -> str:
    """From where to where costs are reported, downwards; empty where none are.

    Example:
        >>> from descentflow.diagnosis.diagnose import diagnose
        >>> from descentflow.effects import EFFECTS
        >>> levels_of(diagnose("descents.parquet", "A320", catalogue={"mass": EFFECTS["mass"]}))
        'From FL345 down to FL150'
    """
    if not found.costs:
        return ""
    low, high = level_range(found.costs[0].low_fl, found.costs[0].high_fl).split(" to ")
    return f"From {high} down to {low}"
