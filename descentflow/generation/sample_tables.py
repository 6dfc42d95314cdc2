"""Sampled descents as the long table and the NetCDF file that users read, in field units."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
from torch import Tensor

from descentflow.air.level_air import LevelAir
from descentflow.core.files import whole_file
from descentflow.core.tabular import optional_library, write_table
from descentflow.core.units import FPM_MPS, KT_MPS, NM_M
from descentflow.generation.sample_columns import COLUMNS
from descentflow.physics.fuel import CO2_PER_FUEL, burnt_kg
from descentflow.positions.placing import Positions, place
from descentflow.representation.decoder.trajectories import Trajectories, burn_of

TIMESTAMP = pl.Datetime("us", "UTC")
NO_TABLE = pl.DataFrame()
"""Contexts of samples that have none: no columns."""


def flown_quantities(flown: Trajectories) -> dict[str, Tensor]:
    """Quantities of samples that need no air and no path, as (n, L); fuel where the model is known.

    Example:
        >>> from descentflow.generation.sample import sample
        >>> flown = flown_quantities(sample("best.ckpt", 3, entry_fl=330).trajectories)
        >>> round(float((flown["co2_kg"] / flown["fuel_kg"])[0, 0]), 2)
        3.16
    """
    quantities = {
        "time_s": flown.time_s,
        "altitude_ft": (flown.levels_fl * 100).expand(flown.time_s.shape),
        "CAS": flown.cas_mps / KT_MPS,
        "Mach": flown.mach,
        "TAS": flown.tas_mps / KT_MPS,
        "vertical_rate": flown.rate_mps / FPM_MPS,
        "drag_n": flown.drag_n,
    }
    burnt = burn_of(flown)
    if burnt is None:
        return quantities
    fuel_kg = burnt_kg(burnt.flow_kg_s, flown.time_s, flown.mask)
    fuel = {"thrust_n": burnt.thrust_n, "fuel_flow_kg_s": burnt.flow_kg_s, "fuel_kg": fuel_kg}
    return {**quantities, **fuel, "co2_kg": CO2_PER_FUEL * fuel_kg}


def _quantities(flown: Trajectories, positions: Positions | None, air: LevelAir | None) -> dict[str, np.ndarray]:
    """Each quantity of samples as (n, L) float64, on ascending levels."""
    quantities = {name: tensor.detach().cpu().double().numpy() for name, tensor in flown_quantities(flown).items()}
    tailwind: Tensor | float = 0.0
    if air is not None:
        tailwind = air.tailwind_mps
        quantities |= {"deviation_k": air.deviation_k.numpy(), "tailwind": tailwind.numpy() / KT_MPS}
    return quantities | _over_ground(place(flown, tailwind_mps=tailwind) if positions is None else positions)


def _over_ground(positions: Positions) -> dict[str, np.ndarray]:
    """Distances, groundspeed, and the place and time where they are known."""
    distances = {
        "distance_nm": positions.distance_m / NM_M,
        "distance_to_go_nm": positions.to_go_m / NM_M,
        "top_of_descent_nm": np.broadcast_to(positions.top_of_descent_m[:, None] / NM_M, positions.to_go_m.shape),
        "groundspeed": positions.groundspeed_mps / KT_MPS,
    }
    places = {name: getattr(positions, name) for name in ("latitude", "longitude", "track", "unix_s")}
    return distances | {name: values for name, values in places.items() if values is not None}


def to_frame(
    flown: Trajectories,
    context: pl.DataFrame = NO_TABLE,
    positions: Positions | None = None,
    air: LevelAir | None = None,
) -> pl.DataFrame:
    """Long table: one row for each sample and level, from the entry level downwards.

    Args:
        flown: n descents.
        context: Contexts in the order of the samples: sample i has row i, beginning again after the last.
        positions: Where they are flown; distances in still air, and no places, if absent.
        air: Air (n, L) of each; in standard air if absent.

    Returns:
        Columns ``sample_id level_fl`` and others of :mod:`~descentflow.generation.sample_columns`; then the
        sample's context, its columns called ``given_...``.

    Example:
        >>> from descentflow.generation.sample import sample
        >>> flown = sample("best.ckpt", 3, entry_fl=330).trajectories
        >>> table = to_frame(flown, pl.DataFrame({"deviation_k": [0.0, 10.0]}))
        >>> table.filter(level_fl=330).select("sample_id", "time_s", "given_deviation_k").rows()
        [(0, 0.0, 0.0), (1, 0.0, 10.0), (2, 0.0, 0.0)]
    """
    n, n_levels = flown.time_s.shape
    # Reversed levels put each sample's rows in the order in which they are flown.
    keep = flown.mask.cpu().numpy()[:, ::-1]
    sample_id = np.broadcast_to(np.arange(n, dtype=np.int32)[:, None], (n, n_levels))[keep]
    levels = flown.levels_fl.cpu().numpy().astype(np.int32)[::-1]
    level_fl = np.broadcast_to(levels, (n, n_levels))[keep]
    columns = {name: values[:, ::-1][keep] for name, values in _quantities(flown, positions, air).items()}
    table = pl.DataFrame({"sample_id": sample_id, "level_fl": level_fl, **columns})
    if "unix_s" in columns:
        stamps = (1e6 * pl.col("unix_s")).round().cast(pl.Int64).cast(TIMESTAMP)
        table = table.with_columns(timestamp=stamps).drop("unix_s")
    if not context.width:
        return table
    rows = context[sample_id % len(context)]
    return table.with_columns([rows[name].alias(f"given_{name}") for name in context.columns])


def to_dataset(
    flown: Trajectories,
    context: pl.DataFrame = NO_TABLE,
    positions: Positions | None = None,
    air: LevelAir | None = None,
) -> Any:
    """The descents as an `xarray.Dataset`: dimensions sample and level, NaN above a sample's entry level.

    Args:
        flown: n descents.
        context: Contexts of the samples as in :func:`to_frame`: coordinates ``given_...`` of each sample.
        positions: As in :func:`to_frame`.
        air: As in :func:`to_frame`.

    Raises:
        ConfigError: If xarray is not installed.

    Example:
        >>> from descentflow.generation.sample import sample
        >>> flown = sample("best.ckpt", 3, entry_fl=330).trajectories
        >>> data = to_dataset(flown)
        >>> data["CAS"].dims, data["CAS"].attrs["units"]
        (('sample', 'level'), 'kt')
    """
    mask = flown.mask.cpu().numpy()
    variables = {
        name: (("sample", "level"), np.where(mask, values, np.nan), {"units": COLUMNS[name].unit})
        for name, values in _quantities(flown, positions, air).items()
    }
    coordinates: dict[str, Any] = {"level_fl": ("level", flown.levels_fl.cpu().numpy().astype(np.int32))}
    if context.width:
        rows = context[np.arange(len(flown)) % len(context)]
        coordinates |= {f"given_{name}": ("sample", rows[name].to_list()) for name in context.columns}
    return optional_library("xarray").Dataset(variables, coords=coordinates)


def write_samples(
    flown: Trajectories,
    path: Path,
    context: pl.DataFrame = NO_TABLE,
    positions: Positions | None = None,
    air: LevelAir | None = None,
    origin: Mapping[str, str] | None = None,
) -> None:
    """Write a table (``.parquet``, ``.csv``) or a NetCDF-3 file (``.nc``), whole or not at all.

    Args:
        flown: n descents.
        path: The file.
        context: Contexts of the samples: a table holds them as :func:`to_frame` does, a NetCDF file holds their row.
        positions: As in :func:`to_frame`.
        air: As in :func:`to_frame`.
        origin: Names and texts for the metadata of Parquet and the attributes of NetCDF.

    Raises:
        ConfigError: If the extension is none of these.
        DataError: If the folder does not exist.

    Example:
        >>> from descentflow.generation.sample import sample
        >>> flown = sample("best.ckpt", 3, entry_fl=330).trajectories
        >>> write_samples(flown, Path("three.csv"))
        >>> pl.read_csv("three.csv")["sample_id"].n_unique()
        3
    """
    if path.suffix != ".nc":
        write_table(to_frame(flown, context, positions, air), path, origin, beside=", .nc")
        return
    with whole_file(path) as temporary:
        _write_netcdf(flown, temporary, context, _quantities(flown, positions, air), origin or {})


def _write_netcdf(
    flown: Trajectories,
    path: Path,
    context: pl.DataFrame,
    quantities: Mapping[str, np.ndarray],
    origin: Mapping[str, str],
) -> None:
    """Dimensions sample and level (ascending), with ``level_fl`` as coordinate; NaN above a sample's entry level."""
    from scipy.io import netcdf_file  # here: whatever draws samples would pay for it otherwise

    n, n_levels = flown.time_s.shape
    with netcdf_file(path, "w") as file:
        for name, text in {"title": "Sampled aircraft descents (descentflow)", **origin}.items():
            setattr(file, name, text.encode())
        file.createDimension("sample", n)
        file.createDimension("level", n_levels)
        level = file.createVariable("level_fl", "i4", ("level",))
        level[:] = flown.levels_fl.cpu().numpy().astype(np.int32)
        level.long_name = "flight level"
        if context.width:
            row = file.createVariable("given_row", "i4", ("sample",))
            row[:] = np.arange(n, dtype=np.int32) % len(context)
        mask = flown.mask.cpu().numpy()
        for name, values in quantities.items():
            variable = file.createVariable(name, "f8", ("sample", "level"))
            variable.units, variable.coordinates = COLUMNS[name].unit, "level_fl"
            variable[:] = np.where(mask, values, np.nan)
