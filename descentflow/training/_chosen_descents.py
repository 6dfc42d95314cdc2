"""Choice of the prepared descents a model is fitted to, of whose coefficients fly them, and of their cleaning."""

import warnings
from pathlib import Path

import polars as pl

from descentflow.aircraft_types.registry import aircraft as find_aircraft
from descentflow.core.errors import ConfigError, DataError, DescentflowWarning
from descentflow.physics.performance_model import PerformanceModel
from descentflow.surveillance.cleaning.drop_report_checks import tell_absent_types
from descentflow.surveillance.cleaning.thresholds import Cleaning
from descentflow.surveillance.descents.prepared_descents import Descents

OF_REFERENCE = (0.3, 3.0)
"""Least and greatest mass, of the reference mass of the type: what lies beyond is of another unit."""


def name_of(descents: list[Path] | Path | Descents) -> str:
    """The descents' file in messages and checkpoints.

    Example:
        >>> name_of(Path("data/descents.parquet"))
        'descents.parquet'
    """
    if isinstance(descents, str | Path):
        return Path(descents).name
    return ", ".join(Path(table).name for table in descents) if isinstance(descents, list | tuple) else "in memory"


def of_typecodes(source: Descents, typecodes: list[str] | str | None, name: str) -> pl.DataFrame:
    """The table of some types; all if None.

    Raises:
        DataError: If there is none of them.

    Warns:
        DescentflowWarning: If there is none of one of several.

    Example:
        >>> from descentflow.surveillance.descents.prepared_descents import read_descents
        >>> of_typecodes(read_descents("descents.parquet"), ["A320"], "descents.parquet")["flight_id"].n_unique()
        120
    """
    if typecodes is None:
        return source.frame
    if isinstance(typecodes, str):
        typecodes = typecodes.split(",")
    typecodes = [code.strip().upper() for code in typecodes]
    frame = source.frame.filter(pl.col("typecode").is_in(typecodes))
    if frame.is_empty():
        raise DataError(
            f"no descent of {', '.join(typecodes)} in {name}",
            expected=f"some of {', '.join(sorted(source.frame['typecode'].unique()))}",
            mend="change --data.typecodes (in Python: typecodes=)",
        )
    tell_absent_types(typecodes, source.flights, "descent", "data.typecodes")
    return frame


def aircraft_of(frame: pl.DataFrame, typecode: str | None, bada_dir: Path | None) -> PerformanceModel:
    """Coefficients of the type that is named, or of the only one that there is.

    Raises:
        AircraftError: If the type has none.
        ConfigError: If none is named and there are several.

    Example:
        >>> aircraft_of(pl.read_parquet("descents.parquet"), None, None).typecode
        'A320'
    """
    if typecode is not None:
        return find_aircraft(typecode, bada_dir)
    types = sorted(frame["typecode"].unique())
    if len(types) != 1:
        raise ConfigError(
            f"descents of {len(types)} types ({', '.join(types[:8])})",
            expected="one type, or the aircraft whose coefficients stand for all of them",
            mend=f"take them together, --data.aircraft {types[0]}, or one of them, --data.typecodes {types[0]}",
        )
    return find_aircraft(types[0], bada_dir)


def bottom_of(source: Descents, frame: pl.DataFrame, asked_fl: int | None) -> int:
    """Lowest level of the grid: the one that is asked for, or that the descents were prepared with.

    Raises:
        ConfigError: If no descent goes down to it.

    Example:
        >>> from descentflow.surveillance.descents.prepared_descents import read_descents
        >>> descents = read_descents("descents.parquet")
        >>> bottom_of(descents, descents.frame, None), bottom_of(descents, descents.frame, 200)
        (150, 200)
        >>> bottom_of(descents, descents.frame, 100)
        Traceback (most recent call last):
        descentflow.core.errors.ConfigError: data.bottom_fl 100 below the descents, which end at FL150; expected ...
    """
    if asked_fl is None:
        return source.bottom_fl
    lowest = int(frame["level_fl"].to_numpy().min())
    if asked_fl < lowest:
        raise ConfigError(
            f"data.bottom_fl {asked_fl} below the descents, which end at FL{lowest}",
            expected=f"FL{lowest} or above",
            mend=f"leave it out, or prepare the rows again with --bottom-fl {asked_fl}",
        )
    return asked_fl


def at_mass(aircraft: PerformanceModel, mass_kg: float | None) -> PerformanceModel:
    """The aircraft at the mass that infers its drag; at the reference mass if None.

    Raises:
        ConfigError: If it is no mass of the type in kg.

    Example:
        >>> at_mass(find_aircraft("A320"), 60_000.0).mass_reference_kg
        60000.0
    """
    if mass_kg is None:
        return aircraft
    least, most = (float(aircraft.mass_reference_kg) * share for share in OF_REFERENCE)
    if not least <= mass_kg <= most:
        raise ConfigError(
            f"a mass of {mass_kg:g} kg for the {aircraft.typecode}",
            expected=f"{least:,.0f} kg to {most:,.0f} kg",
            mend="check the unit: kg",
        )
    return aircraft.at_mass(mass_kg)


def known_cleaning(source: Descents) -> Cleaning | None:
    """Thresholds with which descents were cleaned; None, with a warning, if they do not say.

    Warns:
        DescentflowWarning: If they do not say.

    Example:
        >>> from descentflow.surveillance.descents.prepared_descents import read_descents
        >>> known_cleaning(read_descents("descents.parquet")).bottom_fl
        150
    """
    if source.cleaning is None:
        warnings.warn(
            "these descents do not say how they were cleaned, so the model's cleaning settings are unknown and "
            "flights that it is compared with may be cleaned otherwise; to mend it, prepare the rows again",
            DescentflowWarning,
            stacklevel=3,
        )
    return source.cleaning
