"""Samples as a trajectory file of the CF conventions 1.11 (NetCDF-4): an array of trajectories and their points."""

import shutil
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from descentflow.core.files import whole_file
from descentflow.core.tabular import optional_library
from descentflow.exports.export_request import ExportRequest
from descentflow.generation.sample_columns import COLUMNS, FUEL

CONVENTIONS = "CF-1.11"
MISSING = 9.969209968386869e36
"""NetCDF's own fill value of a double, for points that a descent from a lower level has not."""
COORDINATES = {
    "timestamp": ("time", "T"),
    "latitude": ("lat", "Y"),
    "longitude": ("lon", "X"),
    "altitude_ft": ("altitude", "Z"),
}
"""Column -> its variable and axis."""
DATA = ("CAS", "Mach", "TAS", "vertical_rate", "groundspeed", "track", "drag_n", "distance_nm", "distance_to_go_nm")
OWN = (*FUEL, "deviation_k", "tailwind")
"""Columns that are there where one model flew the samples, or they have an air of their own."""


def write(request: ExportRequest) -> list[Path]:
    """Write the flights: dimensions trajectory and obs, from the entry level down.

    Raises:
        ConfigError: If netCDF4 is not installed.

    Example:
        >>> from descentflow.densities.checkpoint import load_model
        >>> from descentflow.positions.ground_plan import ground_plan
        >>> plan = ground_plan(end=(51.47, -0.45), track=270.0, end_time="2026-11-22T10:00:00")
        >>> _ = write(ExportRequest(load_model("best.ckpt"), Path("cf.nc"), n=2, plan=plan))
        >>> import netCDF4
        >>> with netCDF4.Dataset("cf.nc") as file:
        ...     file.featureType, file["time"].dimensions
        ('trajectory', ('trajectory', 'obs'))
    """
    netcdf = optional_library("netCDF4", extra="wind")
    with whole_file(request.path) as temporary, TemporaryDirectory() as folder:
        # HDF5 locks the files that it writes, and a file that is to be written whole is locked already.
        written = Path(folder) / "flights.nc"
        with netcdf.Dataset(written, "w", format="NETCDF4") as file:
            _fill_file(file, request)
        shutil.copyfile(written, temporary)
    return [request.path]


def _fill_file(file: Any, request: ExportRequest) -> None:
    """Dimensions, attributes and variables."""
    table = request.flights()
    number = table["sample_id"].to_numpy()
    starts = np.flatnonzero(np.diff(number, prepend=-1))
    place = number, np.arange(len(number)) - starts[number]
    file.createDimension("trajectory", request.n)
    file.createDimension("obs", int(place[1].max()) + 1)
    _describe(file, request)
    names = file.createVariable("flight_id", str, ("trajectory",))
    names.cf_role, names.long_name = "trajectory_id", "identifier of the sample"
    names[:] = table["flight_id"].to_numpy()[starts].astype(object)
    for column, (name, axis) in COORDINATES.items():
        variable = _variable(file, name, column)
        variable.axis = axis
        if column == "altitude_ft":
            variable.positive = "up"
        if column == "timestamp":
            variable.units, variable.calendar = "seconds since 1970-01-01T00:00:00Z", "standard"
            variable.units_metadata = "leap_seconds: none"
        _fill(variable, place, _numbers(table, column))
    for column in (*DATA, *(name for name in OWN if name in table.columns)):
        variable = _variable(file, column, column)
        variable.coordinates = "time lat lon altitude"
        _fill(variable, place, _numbers(table, column))


def _variable(file: Any, name: str, column: str) -> Any:
    variable = file.createVariable(name, "f8", ("trajectory", "obs"), fill_value=MISSING, compression="zlib")
    about = COLUMNS[column]
    variable.units, variable.long_name = about.udunit, about.meaning
    if about.standard_name is not None:
        variable.standard_name = about.standard_name
    if column == "deviation_k":
        variable.units_metadata = "temperature: difference"
    return variable


def _fill(variable: Any, place: tuple[Any, Any], values: Any) -> None:
    grid = np.full(variable.shape, MISSING)
    grid[place] = values
    variable[:] = grid


def _numbers(table: Any, column: str) -> Any:
    values = table[column]
    return values.dt.epoch("us").to_numpy() / 1e6 if column == "timestamp" else values.to_numpy()


def _describe(file: Any, request: ExportRequest) -> None:
    file.Conventions, file.featureType = CONVENTIONS, "trajectory"
    file.title = f"Sampled descents of {request.typecode}"
    file.institution = "unknown: whoever drew the samples may say it here"
    file.setncatts(request.samples.origin)
    file.history = f"{request.samples.origin['date_created']} descentflow export --to cf"
    file.references = "Hodgkin, Pepper and Thomas (2025), Probabilistic Simulation of Aircraft Descent"
    file.comment = "Generated flights: identifiers are invented, and no such flight took place."
