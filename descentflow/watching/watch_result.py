"""Result of a watch: new days, the alarm that stands, and both in words."""

from dataclasses import dataclass, field
from typing import Any

import polars as pl

from descentflow.diagnosis.report.page import listed
from descentflow.watching.state import WatchSettings


@dataclass(frozen=True)
class Watch:
    """New days and the alarm after a run of a watch.

    Attributes:
        new_days: One dictionary for each day that is new: day, flights, e-value, alarm.
        left_out: File or day -> why it was not taken.
        alarm: The alarm that stands: when it was raised, the day of change with its interval, shape, size, cause.
        is_new: Whether this run raised it.
        settings: Of the watch.
        days: A line for each day, see :meth:`~descentflow.watching.state.State.days`.

    Example:
        >>> from descentflow.watching.watch import watch
        >>> watched = watch("A320", "descents.parquet", state="watched-once")
        >>> watched.alarm is None, len(watched.new_days)
        (True, 5)
        >>> print(watched)
        5 days against nominal A320, 5 of them new: no alarm; the reference lacks 25 of its 30 days.
    """

    new_days: list[dict[str, Any]]
    left_out: dict[str, str]
    alarm: dict[str, Any] | None
    is_new: bool
    settings: WatchSettings
    days: pl.DataFrame = field(repr=False)

    def __str__(self) -> str:
        """The answer in a line or two."""
        days, new = len(self.days), len(self.new_days)
        head = f"{days} days against {self.settings.simulator}, {new} of them new: {standing(self)}"
        return "\n".join([head, *(f"left out: {name}: {why}" for name, why in self.left_out.items())])


def standing(watched: Watch) -> str:
    """The alarm that stands in words, or that there is none."""
    alarm, settings = watched.alarm, watched.settings
    if alarm is None:
        counted = watched.days.filter(pl.col("day") >= (settings.since or ""))
        short = max(settings.reference_days - len(counted), 0)
        return "no alarm" + (f"; the reference lacks {short} of its {settings.reference_days} days." if short else ".")
    change = alarm["change"]
    sizes = listed([f"{size:+.3g} {name.partition('(')[2].rstrip(')')}" for name, size in alarm["size"].items()])
    said = (
        f"an alarm since {alarm['raised']}. A {alarm['shape']} from {change['day']} on "
        f"({change['earliest']} to {change['latest']}), {sizes} a descent."
    )
    return f"{said} {cause_in_words(alarm.get('cause', {}))}"


def cause_in_words(cause: dict[str, Any]) -> str:
    """The cause of a change.

    Example:
        >>> cause_in_words({"verdict": "unknown"})
        'Its cause is unknown.'
        >>> cause_in_words({"in_words": ["drag polar: CD0 x 1.1"], "weather": ["temperature: + 3 K"]})
        'Its cause: drag polar: CD0 x 1.1. The weather of these days differs, too: temperature: + 3 K.'
    """
    known, weather, why = cause.get("in_words", []), cause.get("weather", []), cause.get("why")
    if cause.get("only_the_weather"):
        return f"Only the weather differs: {listed(weather)}."
    said = f"Its cause: {listed(known)}." if known else f"Its cause is unknown{f': {why}' if why else ''}."
    return f"{said} The weather of these days differs, too: {listed(weather)}." if weather else said
