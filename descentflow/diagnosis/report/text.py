"""The answer in words, for the terminal and the top of the page."""

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from descentflow.diagnosis.report.gap_report import GapReport

NAMES = {
    "rate": "rate of descent",
    "lag": "reported rate against altitude over time",
    "cas": "calibrated airspeed",
    "mismatch": "IAS against Mach number",
    "tas": "true airspeed against Mach number",
    "wind": "change of the along-track wind",
    "height": "geometric against pressure altitude",
    "noise_rate": "noise of the vertical rate",
    "noise_cas": "noise of IAS",
    "noise_mach": "noise of Mach",
    "noise_tas": "noise of TAS",
    "noise_groundspeed": "noise of groundspeed",
    "noise_altitude": "noise of altitude",
    "level": "time in level-offs",
    "level_gaps": "number of level-offs",
    "slow": "time in slow stretches",
    "missing": "levels cut out as managed",
}
SAYS = {
    "temperature": "air warmer or colder than the standard atmosphere",
    "wind_gradient": "an along-track wind that changes with altitude",
    "mass": "heavier or lighter aircraft",
    "idle_thrust": "more or less thrust at idle",
    "drag_polar": "more or less drag of the airframe",
    "speed_brake": "speed brakes, or as much drag, within a band of altitude",
    "geometric_path": "a fixed path over the ground instead of an idle descent",
    "vertical_speed_mode": "a selected vertical rate instead of an idle descent",
    "level_off": "more level-offs or longer ones",
    "speed_schedule": "other descent speeds",
    "airspeed_bias": "biased airspeed reports",
    "vertical_rate_lag": "vertical rates reported late",
    "measurement_noise": "noisier or coarser reports",
}


DIRECTIONS = {
    "temperature": ("air warmer than the standard atmosphere", "air colder than the standard atmosphere"),
    "wind_gradient": ("a tailwind that grows with altitude", "a tailwind that falls with altitude"),
    "mass": ("heavier aircraft", "lighter aircraft"),
    "idle_thrust": ("more thrust at idle", "less thrust at idle"),
    "drag_polar": ("more drag of the airframe", "less drag of the airframe"),
    "airspeed_bias": ("airspeeds that read too high", "airspeeds that read too low"),
    "speed_schedule": ("faster descents", "slower descents"),
    "level_off": ("more time in level-offs", "less time in level-offs"),
}
"""What a positive and a negative first parameter mean, where that has a name."""


def cause_in_words(cause: dict[str, Any]) -> str:
    """An effect with the direction that was found."""
    name = str(cause["effect"])
    first = next(iter(cause["parameters"].values()), None)
    if name not in DIRECTIONS or first is None:
        return SAYS.get(name, name)
    return DIRECTIONS[name][0 if first["estimate"] > 0 else 1]


def number(value: float) -> str:
    """Three digits, without an exponent where a reader can do without."""
    return f"{value:.3g}" if abs(value) < 1000 else f"{value:.0f}"


def percent(share: float | None) -> str:
    """A share, or a dash."""
    return "-" if share is None else f"{100 * share:.0f} %"


def interval(parameter: dict[str, Any]) -> str:
    """The 90 % interval in brackets; nothing where none is claimed."""
    if parameter["low"] is None:
        return ""
    return f" ({number(parameter['low'])} to {number(parameter['high'])})"


def unit(parameter: dict[str, Any]) -> str:
    """The unit with a space before it; nothing for a plain number."""
    return "" if parameter["unit"] == "1" else f" {parameter['unit']}"


def sizes(cause: dict[str, Any]) -> str:
    """Parameters with their intervals."""
    return "; ".join(f"{name} {number(p['estimate'])}{interval(p)}{unit(p)}" for name, p in cause["parameters"].items())


def sentences(report: "GapReport") -> list[str]:
    """Where, what, and how far: three sentences."""
    cell = next((c for c in report.where if c["share"] > 0), None)
    if report.verdict == "none":
        return [
            f"The flights do not differ from the simulator's by more than chance would (p = {report.p_value:.2g}).",
            "No effect is named.",
            f"The gap of {report.gap_before:.3f} spreads is what two samples of one population show "
            f"({report.floor:.3f}).",
        ]
    place = "no single cell stands out"
    if cell is not None:
        name = NAMES.get(cell["quantity"], cell["quantity"])
        place = f"most of it in the {name}, FL{cell['level_low_fl']:.0f} to FL{cell['level_high_fl']:.0f}"
    first = f"The flights differ from the simulator's (p = {report.p_value:.2g}): {place}."
    if report.details.get("regime") == "refit":
        first = (
            f"The flights are as the simulator's own were, but not as it assumes (p = {report.p_value:.2g}): {place}."
        )
    if report.verdict == "unknown":
        left = report.remaining["largest"]
        return [
            first,
            "No effect of the catalogue explains it, alone or with others: the cause lies outside.",
            f"The largest difference is {number(left['difference'])} in the "
            f"{NAMES.get(left['quantity'], left['quantity'])}, FL{left['level_low_fl']:.0f} to "
            f"FL{left['level_high_fl']:.0f}.",
        ]
    causes = " and ".join(cause_in_words(c) for c in report.causes)
    alike = sorted({name.replace("_", " ") for c in report.causes for name in c["group"]})
    doubt = f", though these data cannot tell it from {', '.join(alike)}" if alike else ""
    closed = report.causes[0]["closure"]["marginal"]["estimate"]
    are, them = ("causes are", "them") if len(report.causes) > 1 else ("cause is", "it")
    return [
        first,
        f"The {are} {causes}{doubt}.",
        f"With {them} in the simulator the gap shrinks from {report.gap_before:.3f} to {report.gap_after:.3f} spreads, "
        f"where {report.floor:.3f} is the least that can be seen ({percent(closed)} closed).",
    ]


def summary(report: "GapReport") -> str:
    """For a terminal."""
    lines = sentences(report)
    for cause in report.causes:
        lines.append(f"  {cause['effect']}: {sizes(cause)}")
        if cause["group"]:
            lines.append(f"    could also be: {', '.join(cause['group'])}")
    lines += [
        f"  would tell more: {', '.join(s['channels'])} (between {', '.join(s['between'])})"
        for s in report.would_split
        if s["channels"]
    ]
    return "\n".join(lines)
