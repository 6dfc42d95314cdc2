"""Source of wind and temperature for rows without airspeeds: a weather field, columns of the rows, or neighbours."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import polars as pl

from descentflow.core.errors import ConfigError, DataError

COLUMNS_OF_ROWS, NEIGHBOURS, FIELD = "columns", "neighbours", "field"
"""Words of the argument, and of the column `airspeed_source` next to `reported`."""
REPORTED = "reported"
WEATHER_COLUMNS = ("u_component_of_wind", "v_component_of_wind", "temperature")
"""Columns of the wind towards east and north (m/s) and of the temperature (K), as fastmeteo and the PRC name them."""
PLACED = ("latitude", "longitude")


def derived_flights(frame: pl.DataFrame) -> list[str]:
    """Flights of prepared descents of which most airspeeds are derived.

    Example:
        >>> derived_flights(pl.DataFrame({"flight_id": ["a", "b"], "airspeed_source": ["field", "reported"]}))
        ['a']
    """
    if "airspeed_source" not in frame.columns:
        return []
    shares = frame.group_by("flight_id", maintain_order=True).agg((pl.col("airspeed_source") != REPORTED).mean())
    return shares.filter(pl.col("airspeed_source") > 0.5)["flight_id"].to_list()


@dataclass(frozen=True)
class AirspeedSource:
    """Source of wind and temperature for rows without airspeeds.

    Attributes:
        kind: `columns`, `neighbours` (aircraft of the same rows that report airspeeds) or `field`.
        paths: Files and folders of the field; none of other kinds.

    Example:
        >>> AirspeedSource.of("columns").needed
        ('groundspeed', 'track', 'u_component_of_wind', 'v_component_of_wind', 'temperature')
    """

    kind: str
    paths: tuple[Path, ...] = ()

    @classmethod
    def of(cls, given: Any) -> "AirspeedSource":
        """The source that an argument names.

        Raises:
            ConfigError: If it is neither the word nor a path, or the word and a path.
            DataError: If there is no such file.
        """
        several = [given] if isinstance(given, str | Path) else given
        if not isinstance(several, Sequence) or not several or not all(isinstance(one, str | Path) for one in several):
            raise ConfigError(
                f"airspeeds from {given!r}",
                expected=f"files or a folder of a weather field, {COLUMNS_OF_ROWS!r} or {NEIGHBOURS!r}",
                mend="pass one of these",
            )
        words = {COLUMNS_OF_ROWS, NEIGHBOURS} & {*map(str, several)}
        if words and len(several) == 1:
            return cls(words.pop())
        if words:
            raise ConfigError(
                f"airspeeds from {' and '.join(map(str, several))}",
                expected="one source",
                mend="leave out all but one",
            )
        for path in map(Path, several):
            if not path.exists():
                raise DataError(
                    f"no file {path}", expected=f"a field, {COLUMNS_OF_ROWS!r} or {NEIGHBOURS!r}", mend="check the path"
                )
        return cls(FIELD, tuple(map(Path, several)))

    @property
    def needed(self) -> tuple[str, ...]:
        """Columns that a row without airspeeds must have."""
        others = WEATHER_COLUMNS if self.kind == COLUMNS_OF_ROWS else PLACED
        return ("groundspeed", "track", *others)

    def files(self) -> list[Path]:
        """Files of the field, those of folders included."""
        from descentflow.weather.weather_file import weather_files

        return weather_files(self.paths) if self.paths else []
