"""Fuel that level flight in descents burnt, next to the type at idle; and the files of level flight by flight."""

from pathlib import Path

import polars as pl
import torch

from descentflow.aircraft_types.registry import aircraft
from descentflow.core.errors import AircraftError, ConfigError, UnknownTypeError, warn
from descentflow.core.files import check_folder
from descentflow.core.tabular import write_table
from descentflow.core.units import FT_M, KT_MPS
from descentflow.physics.airspeed import cas_to_tas_mps
from descentflow.physics.fuel import burn
from descentflow.surveillance.cleaning.level_flight import by_flight
from descentflow.surveillance.descents.prepared_descents import Descents

FUEL = ("fuel_kg", "idle_fuel_kg")
FILES = ("flights.csv", "segments.csv", "level_flight.png")


def with_fuel(segments: pl.DataFrame, bada_dir: str | Path | None = None) -> pl.DataFrame:
    """Level flight with its fuel: thrust by the energy equation at the mean IAS and altitude of each segment.

    The thrust is the clean polar's drag and what the change of the airspeed takes, at least idle. The mass is the
    type's reference mass, and the air is standard.

    Args:
        segments: Of ``Descents.level_flight``.
        bada_dir: Folder of BADA 3 or 4; None for the open aircraft.

    Returns:
        The rows with ``fuel_kg``, and ``idle_fuel_kg`` that the type burns at idle in the same seconds, at the same
        altitude and speed. Neither is what a continuous descent burns, which flies that distance in cruise. Missing at
        other kinds, without an IAS, and of types that are not known.

    Warns:
        DescentflowWarning: If the coefficients of a type cannot be read.

    Example:
        >>> where = {"kind": "level", "typecode": "A320", "altitude_ft": 1e4, "IAS": 250.0, "IAS_change": 0.0}
        >>> level = pl.DataFrame([{**where, "seconds": 60.0}])
        >>> [round(kg) for kg in with_fuel(level).select("fuel_kg", "idle_fuel_kg").row(0)]
        [29, 11]
    """
    parts = []
    for (code,), some in segments.with_row_index("row").group_by("typecode", maintain_order=True):
        columns = (some["IAS"] * KT_MPS, some["altitude_ft"] * FT_M, some["seconds"], some["IAS_change"] * KT_MPS / 2)
        cas, altitude, seconds, half = (torch.from_numpy(one.cast(pl.Float64).to_numpy().copy()) for one in columns)
        faster = cas_to_tas_mps(cas + half, altitude) - cas_to_tas_mps(cas - half, altitude)
        try:
            model = aircraft(str(code), bada_dir)
        except AircraftError as error:
            if not isinstance(error, UnknownTypeError):
                warn(f"no fuel of level flight of {code}: {error}")
            flows = [torch.full_like(cas, torch.nan)] * 2
        else:
            idle = model.idle_fuel_flow_kg_s(altitude, cas_to_tas_mps(cas, altitude))
            burnt = burn(model, cas, altitude, 0.0, acceleration_mps2=faster / seconds)
            flows = [burnt.flow_kg_s, idle + 0.0 * cas]
        known = (pl.col("kind") == "level") & pl.col("IAS").is_not_null()
        both = zip(FUEL, flows, strict=True)
        kg = [pl.when(known).then(pl.Series((one * seconds).numpy())).fill_nan(None).alias(name) for name, one in both]
        parts.append(some.with_columns(kg))
    nothing = [pl.lit(None, pl.Float64).alias(name) for name in FUEL]
    return pl.concat(parts).sort("row").drop("row") if parts else segments.with_columns(nothing)


def write_level_flight(descents: Descents, folder: Path, bada_dir: str | Path | None = None) -> str:
    """Write level flight by flight and by segment, and the picture by altitude, each whole.

    Args:
        descents: From ``prepare``.
        folder: Folder of ``flights.csv``, ``segments.csv`` and ``level_flight.png``.
        bada_dir: See :func:`with_fuel`.

    Returns:
        A line on it.

    Raises:
        ConfigError: If the descents were prepared before: only rows have level flight.

    Example:
        >>> import descentflow as df
        >>> write_level_flight(df.prepare("rows.parquet"), Path("level"))
        'level flight of 120 descents: ... kg each, idle would burn ... in that time'
    """
    from descentflow.reporting.figure_file import write_figure
    from descentflow.surveillance.cleaning.level_flight import side_by_side
    from descentflow.surveillance.figure_pages import level_flight_figure

    if descents.level_flight is None:
        raise ConfigError(
            "descents that were prepared before",
            expected="rows, in which level flight is counted while they are cleaned",
            mend="prepare the rows to another output",
        )
    segments = with_fuel(descents.level_flight, bada_dir)
    flights = by_flight(segments)
    check_folder(folder, *FILES).mkdir(exist_ok=True)
    for table, name in ((flights, FILES[0]), (segments, FILES[1])):
        write_table(table.with_columns(pl.col(pl.Float64).round(3)), folder / name)
    write_figure(level_flight_figure(side_by_side({"flights": descents.report.notes})), folder / FILES[2], 110)
    seconds, level = float(flights["level_s"].sum()) / max(len(flights), 1), flights.filter(pl.col("segments") > 0)
    known = level.drop_nulls("fuel_kg")
    line = f"level flight of {len(flights)} descents: {seconds:.0f} s a flight"
    line += f"; fuel is known of {len(known)} of the {len(level)} that level off"
    fuel, idle = (float(known[name].sum()) / max(len(known), 1) for name in FUEL)
    return f"{line}: {fuel:.1f} kg each, idle would burn {idle:.1f} in that time" if len(known) else line
