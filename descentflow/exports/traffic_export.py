"""Flights for the library traffic: a Parquet file that ``Traffic.from_file`` reads."""

from pathlib import Path

import polars as pl

from descentflow.core.files import whole_file
from descentflow.exports.export_request import ExportRequest

NAMES = {"altitude_ft": "altitude", "CAS": "IAS"}
"""Columns that traffic calls otherwise; its IAS is what our CAS is, for position errors are unknown."""
KEPT: tuple[str, ...] = ("timestamp", "flight_id", "callsign", "icao24", "typecode", "altitude", "latitude")
KEPT += ("longitude", "groundspeed", "track", "vertical_rate", "IAS", "Mach", "TAS", "distance_to_go_nm")


def flights(request: ExportRequest) -> pl.DataFrame:
    """One row for each flight and second (``step_s``) in traffic's names and units, in the order of time.

    Example:
        >>> from descentflow.densities.checkpoint import load_model
        >>> from descentflow.positions.ground_plan import ground_plan
        >>> plan = ground_plan(end=(51.47, -0.45), track=270.0, end_time="2026-11-22T10:00:00")
        >>> flights(ExportRequest(load_model("best.ckpt"), Path("t.parquet"), n=2, plan=plan)).columns[:4]
        ['timestamp', 'flight_id', 'callsign', 'icao24']
    """
    return request.flights().rename(NAMES).select(KEPT)


def write(request: ExportRequest) -> list[Path]:
    """Write the flights.

    Example:
        >>> from descentflow.densities.checkpoint import load_model
        >>> from descentflow.positions.ground_plan import ground_plan
        >>> plan = ground_plan(end=(51.47, -0.45), track=270.0, end_time="2026-11-22T10:00:00")
        >>> write(ExportRequest(load_model("best.ckpt"), Path("t.parquet"), n=2, plan=plan))[0].name
        't.parquet'
    """
    with whole_file(request.path) as temporary:
        flights(request).write_parquet(temporary)
    return [request.path]
