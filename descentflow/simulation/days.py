"""Days of flights as files, whose aircraft change on a date: what a watch over a simulator is tried on."""

from collections.abc import Callable, Mapping
from dataclasses import replace
from datetime import date
from pathlib import Path

import polars as pl

from descentflow.aircraft_types.registry import aircraft as find_aircraft
from descentflow.core.arguments import Count, NotNegativeInt, Output, checked_arguments
from descentflow.core.errors import ConfigError
from descentflow.core.files import check_folder
from descentflow.core.tabular import write_table
from descentflow.simulation.plantable import Values
from descentflow.simulation.scenarios import PLAIN, scenario_settings
from descentflow.simulation.world import World, simulate
from descentflow.simulation.world_config import WorldConfig

Plant = Mapping[str, Values]


@checked_arguments
def simulate_days(
    typecode: str,
    n_flights: Count,
    days: Count,
    out: Output,
    *,
    seed: NotNegativeInt = 0,
    scenario: str | Path | WorldConfig | None = None,
    bada_dir: str | Path | None = None,
    plant: Plant | None = None,
    changes: Mapping[str, Plant] | None = None,
    progress: Callable[[int], object] | None = None,
) -> list[Path]:
    """Fly flights over some days and write the rows of each day to a file of its own.

    From the date of a change on, flights have the planted effects of that change in place of those before. Flights of
    one number are the same in all but the effects, and so is the weather of a day.

    Args:
        typecode: Type designator.
        n_flights: Flights in all.
        days: Days over which they are spread.
        out: Folder, made if absent.
        seed: The same seed gives the same flights.
        scenario: As :func:`~descentflow.simulation.world.simulate` has it.
        bada_dir: As there.
        plant: Effects from the first day on.
        changes: Date (ISO 8601) -> effects from then on.
        progress: Called with the number of flights just finished.

    Returns:
        The files, in the order of days.

    Raises:
        ConfigError: If a date is none, or as :func:`~descentflow.simulation.world.simulate` has it.

    Example:
        >>> files = simulate_days("A320", 60, 6, "six", changes={"2024-03-06": {"drag_polar": {"factor": 1.1}}})
        >>> [path.name for path in files][:2]
        ['2024-03-04.parquet', '2024-03-05.parquet']
    """
    kind = find_aircraft(typecode, bada_dir)
    config = scenario if isinstance(scenario, WorldConfig) else scenario_settings(str(scenario or PLAIN), kind)
    config = replace(config, days=days)
    begins = {date.min: plant or {}, **{_date(text): effects for text, effects in (changes or {}).items()}}
    target, dates = check_folder(out), sorted(begins)
    target.mkdir(parents=True, exist_ok=True)
    written = []
    for first, until in zip(dates, [*dates[1:], date.max], strict=True):
        flown = simulate(kind, n_flights, seed, config, plant=begins[first], progress=progress)
        for day, rows in _by_day(flown).items():
            if first <= day < until:
                path = target / f"{day.isoformat()}.parquet"
                write_table(rows, path)
                written.append(path)
    return written


def _date(text: str) -> date:
    try:
        return date.fromisoformat(text)
    except ValueError as error:
        raise ConfigError(f"the date {text!r}", expected="one as 2026-03-14", mend="correct it") from error


def _by_day(flown: World) -> dict[date, pl.DataFrame]:
    """Rows by the day on which their flight began."""
    began = pl.col("timestamp").min().over("icao24", "callsign").dt.date()
    rows = flown.rows.with_columns(day=began)
    return {day: rows.filter(pl.col("day") == day).drop("day") for day in rows["day"].unique().sort().to_list()}
