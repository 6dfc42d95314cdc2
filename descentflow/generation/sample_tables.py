"""Sampled descents as the long table and the NetCDF file that users read, in field units."""

from pathlib import Path

import numpy as np
import polars as pl
from scipy.io import netcdf_file

from descentflow.core.errors import ConfigError
from descentflow.core.files import whole_file
from descentflow.core.units import FPM_MPS, KT_MPS
from descentflow.representation.decoder.trajectories import Trajectories

UNITS = {
    "time_s": "s",
    "altitude_ft": "ft",
    "CAS": "kt",
    "Mach": "1",
    "TAS": "kt",
    "vertical_rate": "ft/min",
    "drag_n": "N",
}


def quantities(flown: Trajectories) -> dict[str, np.ndarray]:
    """Each quantity of :data:`UNITS` as (n, L) float64, on ascending levels."""
    altitude_ft = (flown.levels_fl * 100).expand(flown.time_s.shape)
    tensors = {
        "time_s": flown.time_s,
        "altitude_ft": altitude_ft,
        "CAS": flown.cas_mps / KT_MPS,
        "Mach": flown.mach,
        "TAS": flown.tas_mps / KT_MPS,
        "vertical_rate": flown.rate_mps / FPM_MPS,
        "drag_n": flown.drag_n,
    }
    return {name: tensor.detach().cpu().double().numpy() for name, tensor in tensors.items()}


def to_frame(flown: Trajectories, given: pl.DataFrame | None = None) -> pl.DataFrame:
    """Long table: one row per sample and level, from the entry level downwards.

    Columns: ``sample_id level_fl`` and those of :data:`UNITS`; then, with ``given``, the context of each sample, its
    columns called ``given_...``: sample i is of row i, beginning again after the last.
    """
    n, n_levels = flown.time_s.shape
    # Reversed levels put each sample's rows in the order in which they are flown.
    keep = flown.mask.cpu().numpy()[:, ::-1]
    sample_id = np.broadcast_to(np.arange(n, dtype=np.int32)[:, None], (n, n_levels))[keep]
    levels = flown.levels_fl.cpu().numpy().astype(np.int32)[::-1]
    level_fl = np.broadcast_to(levels, (n, n_levels))[keep]
    columns = {name: values[:, ::-1][keep] for name, values in quantities(flown).items()}
    table = pl.DataFrame({"sample_id": sample_id, "level_fl": level_fl, **columns})
    if given is None:
        return table
    contexts = given[sample_id % len(given)]
    return table.with_columns([contexts[name].alias(f"given_{name}") for name in given.columns])


def write_samples(flown: Trajectories, path: Path, given: pl.DataFrame | None = None) -> None:
    """Write a table (``.parquet``, ``.csv``) or a NetCDF-3 file (``.nc``), whole or not at all.

    With ``given`` the table holds the context of each sample, see :func:`to_frame`; the NetCDF file holds its row.

    Raises:
        ConfigError: If the extension is none of these.
    """
    writers = {".parquet": _write_parquet, ".csv": _write_csv, ".nc": _write_netcdf}
    if path.suffix not in writers:
        raise ConfigError(
            f"output {path.name}", expected=f"an extension among {', '.join(writers)}", mend="rename the output"
        )
    with whole_file(path) as temporary:
        writers[path.suffix](flown, temporary, given)


def _write_parquet(flown: Trajectories, path: Path, given: pl.DataFrame | None) -> None:
    to_frame(flown, given).write_parquet(path)


def _write_csv(flown: Trajectories, path: Path, given: pl.DataFrame | None) -> None:
    to_frame(flown, given).write_csv(path)


def _write_netcdf(flown: Trajectories, path: Path, given: pl.DataFrame | None) -> None:
    """Dimensions sample and level (ascending); NaN above a sample's entry level."""
    n, n_levels = flown.time_s.shape
    with netcdf_file(path, "w") as file:
        file.title = "Sampled aircraft descents (descentflow)"
        file.createDimension("sample", n)
        file.createDimension("level", n_levels)
        level = file.createVariable("level_fl", "i4", ("level",))
        level[:] = flown.levels_fl.cpu().numpy().astype(np.int32)
        if given is not None:
            row = file.createVariable("given_row", "i4", ("sample",))
            row[:] = np.arange(n, dtype=np.int32) % len(given)
        mask = flown.mask.cpu().numpy()
        for name, values in quantities(flown).items():
            variable = file.createVariable(name, "f8", ("sample", "level"))
            variable.units = UNITS[name]
            variable[:] = np.where(mask, values, np.nan)
