"""The table of samples as Parquet, with unit and meaning of each column in its field's metadata."""

from collections.abc import Mapping
from pathlib import Path

import polars as pl

from descentflow.core.files import whole_file
from descentflow.core.tabular import optional_library
from descentflow.exports.export_request import ExportRequest
from descentflow.generation.sample_columns import COLUMNS


def write(request: ExportRequest) -> list[Path]:
    """Write the flights; every field has ``units`` and ``description`` in its Arrow metadata.

    Raises:
        ConfigError: If arro3-core is not installed.

    Example:
        >>> from descentflow.densities.checkpoint import load_model
        >>> _ = write(ExportRequest(load_model("best.ckpt"), Path("units.parquet"), n=2))
        >>> from arro3.io import read_parquet
        >>> read_parquet("units.parquet").schema.field("CAS").metadata_str["units"]
        'knot'
    """
    write_with_units(request.flights(), request.path, request.samples.origin)
    return [request.path]


def write_with_units(table: pl.DataFrame, path: Path, origin: Mapping[str, str]) -> None:
    """Write a table with columns of :mod:`~descentflow.generation.sample_columns`, or that begin with ``given_``.

    Args:
        table: The table.
        path: The file.
        origin: Names and texts for the metadata of the whole.

    Raises:
        ConfigError: If arro3-core is not installed.

    Example:
        >>> write_with_units(pl.DataFrame({"CAS": [280.0]}), Path("speed.parquet"), {"typecode": "A320"})
        >>> pl.read_parquet("speed.parquet")["CAS"].to_list()
        [280.0]
    """
    arro3 = optional_library("arro3.core", extra="parquet-units")
    plain = arro3.Table.from_arrow(table.head(0)).schema
    fields = [plain.field(i).with_metadata(_metadata(name)) for i, name in enumerate(table.columns)]
    with whole_file(path) as temporary:
        table.write_parquet(temporary, arrow_schema=arro3.Schema(fields), metadata=dict(origin))


def _metadata(name: str) -> dict[str, str]:
    if name.startswith("given_"):
        return {"description": f"context {name.removeprefix('given_')} that the sample was drawn for"}
    return {"units": COLUMNS[name].udunit, "description": COLUMNS[name].meaning}
