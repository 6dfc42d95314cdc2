"""Next steps, in the order in which they help: the recipe, what would decide, and where to look."""

from pathlib import Path

from descentflow.diagnosis.findings.findings import Findings
from descentflow.diagnosis.report.trade_units import level_range, trade_number
from descentflow.diagnosis.report.words import (
    limit_words,
    simulator_name,
    size_words,
    spoken,
    tells_a_slope_of_wind,
)
from descentflow.effects import EFFECTS
from descentflow.measurements.quantity_registry import label_of

SHOWN_FLIGHTS = 8
"""Flights that are named."""
SAMPLED = ("training flights", "samples")
"""Origins of the simulator's side, if the simulator is a checkpoint or a model."""
MEAN_WIND = (
    "Let the wind change about the mean wind that each flight has: its change with altitude says nothing of the wind "
    "at any one level, which groundspeed and TAS say."
)
"""Note for the owner of a simulator who enters a wind by its slope."""
SHOWN_LIMITS = 3
"""Effects of which it is said what size would have been found."""


def next_steps(found: Findings, folder: Path | None = None) -> list[str]:
    """Sentences, most useful first; commands stand between backticks.

    Args:
        found: What the diagnosis found.
        folder: Where the report lies, so that commands can be run from elsewhere; beside the report if absent.

    Example:
        >>> from descentflow.diagnosis.diagnose import diagnose
        >>> from descentflow.effects import EFFECTS
        >>> next_steps(diagnose("descents.parquet", "A320", catalogue={"mass": EFFECTS["mass"]}))[0][:44]
        'Put into nominal BADA of the A320: mass x 0.'
    """
    return [
        *_recipe(found, folder),
        *_corrected(found, folder),
        *_flights(found),
        *_channels(found),
        *_own(found),
        *_limits(found),
    ]


def _at(folder: Path | None, name: str) -> str:
    """A file of the report as a command names it."""
    return name if folder is None else str(folder / name)


def _recipe(found: Findings, folder: Path | None) -> list[str]:
    texts = [step.text for step in found.recipe]
    texts = texts or [size_words(cause) or cause.text for cause in found.causes]
    if not texts:
        return []
    if len(texts) > 1:
        texts = [f"({k}) {text}" for k, text in enumerate(texts, 1)]
    change = ""
    if found.details.normal_from != "physics" and found.details.regime == "anchored":
        change = " Each is a change of what its flights have now."
    return [
        f"Put into {simulator_name(found)}: {'; '.join(texts)}.{change}",
        *([MEAN_WIND] if any(tells_a_slope_of_wind(cause) for cause in found.causes) else []),
        f"Fly it again and diagnose it with `--previous {_at(folder, 'gap.json')}`: predicted and achieved closure are "
        "set side by side.",
    ]


def _corrected(found: Findings, folder: Path | None) -> list[str]:
    name = found.corrected_file
    file = f"{name} beside this report" if folder is None else _at(folder, name)
    if name.endswith(".ckpt"):
        command = f"`descentflow sample {_at(folder, name)} -n 1000 --out samples.parquet`"
        return [f"Sample the corrected simulator, {file}: {command}", *_air_of_samples(found)]
    if name:
        return [f"Use the corrected flights: {file} holds the simulator's own flights with the causes."]
    if found.causes and found.details.normal_from in SAMPLED:
        own = spoken([cause.label for cause in found.causes])
        return [f"There is no corrected checkpoint: {own} cannot be held by one, being an effect of your own."]
    return []


def _air_of_samples(found: Findings) -> list[str]:
    """Note on air that the training flights of a corrected checkpoint had and its decoder does not know."""
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
    return ["Write the effect that you suspect into a file of your own and diagnose again with `--catalogue FILE.py`."]


def _limits(found: Findings) -> list[str]:
    """Sizes that would have been found, where nothing was."""
    if found.verdict != "none":
        return []
    told = [limit_words(x) for x in found.details.detection_limits if x.size is not None][:SHOWN_LIMITS]
    if not told:
        return []
    return [f"Smaller causes remain possible: from {spoken(told)} on they would be named in 80 of 100 cases."]
