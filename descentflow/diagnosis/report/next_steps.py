"""What to do next, in the order in which it helps: the recipe, what would decide, and where to look."""

from descentflow.diagnosis.findings.findings import Findings
from descentflow.diagnosis.report.trade_units import level_range, trade_number
from descentflow.diagnosis.report.words import simulator_name, size_words, spoken
from descentflow.effects import EFFECTS
from descentflow.measurements.quantity_registry import label_of

SHOWN_FLIGHTS = 8
"""Flights that are named."""
SAMPLED = ("training flights", "samples")
"""Where the simulator's side comes from, if the simulator is a checkpoint or a model."""
SHOWN_LIMITS = 3
"""Effects of which it is said what size would have been found."""


def next_steps(found: Findings) -> list[str]:
    """Sentences, most useful first.

    Example:
        >>> from descentflow.diagnosis.diagnose import diagnose
        >>> from descentflow.effects import EFFECTS
        >>> next_steps(diagnose("descents.parquet", "A320", catalogue={"mass": EFFECTS["mass"]}))[0][:44]
        'Put into nominal BADA of the A320: mass x 0.'
    """
    return [*_recipe(found), *_corrected(found), *_flights(found), *_channels(found), *_own(found), *_limits(found)]


def _recipe(found: Findings) -> list[str]:
    texts = [step.text for step in found.recipe]
    texts = texts or [size_words(cause) or cause.text for cause in found.causes]
    if not texts:
        return []
    change = ""
    if found.details.normal_from != "physics" and found.details.regime == "anchored":
        change = " Each is a change of what its flights have now."
    return [
        f"Put into {simulator_name(found)}: {'; '.join(texts)}.{change}",
        "Fly it again and diagnose it with --previous gap.json: predicted and achieved closure are set side by side.",
    ]


def _corrected(found: Findings) -> list[str]:
    name = found.corrected_file
    if name.endswith(".ckpt"):
        command = f"descentflow sample {name} -n 1000 --out samples.parquet"
        return [f"Sample the corrected simulator, {name} beside this report: {command}", *_air_of_samples(found)]
    if name:
        return [
            f"Use the corrected flights: {name} beside this report holds the simulator's own flights with the causes."
        ]
    if found.causes and found.details.normal_from in SAMPLED:
        own = spoken([cause.label for cause in found.causes])
        return [f"There is no corrected checkpoint: {own} cannot be held by one, being an effect of your own."]
    return []


def _air_of_samples(found: Findings) -> list[str]:
    """What a corrected checkpoint makes of air that its training flights had and its decoder does not know."""
    warm = next((one for one in found.causes if one.effect in EFFECTS and EFFECTS[one.effect].is_air), None)
    if warm is None or warm.inherited:
        return []
    if not warm.on_both_sides:
        return [
            "Mind that its TAS takes the training flights' air for standard, for no TAS says it: fit with --data.air "
            "measured, on flights that report TAS, where TAS matters."
        ]
    if warm.text in (EFFECTS[warm.effect].directions or ()):
        return []
    return [
        f"Its samples fly in the real flights' air. Those of {simulator_name(found)} itself report the TAS of standard "
        "air, although its training flights flew in another: the TAS that is compared is theirs."
    ]


def _channels(found: Findings) -> list[str]:
    steps = []
    for row in found.would_split:
        if row.channels:
            names = " or ".join(row.channels)
            known = [found.details.label(name) for name in row.between if name != "unknown"]
            what = f"tell {spoken(known)} apart" if known else "help to find the cause"
            steps.append(f"Add {names}: it would {what}.")
    for channel in found.left_out_channels:
        if channel.would_have_told_apart:
            told = [found.details.label(name) for name in channel.would_have_told_apart]
            apart = f"{spoken(told)} apart" if len(told) > 1 else f"{told[0]} from what looks like it"
            side = {"simulator": "the simulator's flights", "real": "the real flights"}.get(
                channel.lacking, channel.lacking
            )
            steps.append(f"Add {channel.channel} to {side}: it would tell {apart}.")
    return list(dict.fromkeys(steps))


def _flights(found: Findings) -> list[str]:
    if found.verdict not in ("unknown", "partial") or not found.flights_worth_a_look:
        return []
    named = [
        f"{f.flight} ({trade_number(f.excess, f.unit, signed=True)})"
        for f in found.flights_worth_a_look[:SHOWN_FLIGHTS]
    ]
    first = found.flights_worth_a_look[0]
    what = f"the {label_of(first.quantity)}, {level_range(first.low_fl, first.high_fl)}"
    return [f"Look at the flights that show most of what no cause explains, in {what}: {', '.join(named)}."]


def _own(found: Findings) -> list[str]:
    if found.verdict not in ("unknown", "partial"):
        return []
    return ["Write the effect that you suspect into a file of your own and diagnose again with --catalogue FILE.py."]


def _limits(found: Findings) -> list[str]:
    """Where nothing was found: the sizes that would have been."""
    if found.verdict != "none":
        return []
    known = [x for x in found.details.detection_limits if x.size is not None]
    told = [f"{found.details.label(x.effect)} {trade_number(x.size or 0.0, x.unit)}" for x in known[:SHOWN_LIMITS]]
    return (
        [f"Take what is smaller for possible still: {spoken(told)} would be named in 80 of 100 cases."] if told else []
    )
