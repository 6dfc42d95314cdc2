"""Tables as pandas and xarray objects; both libraries are optional and imported only when they are asked for."""

import re
import sys
from collections.abc import Mapping, Sequence
from importlib import import_module
from importlib.metadata import PackageNotFoundError, requires
from pathlib import Path
from types import ModuleType
from typing import Any

import polars as pl

from descentflow.core.errors import ConfigError
from descentflow.core.files import whole_file


def optional_library(name: str, extra: str | None = None) -> ModuleType:
    """Import a library that descentflow does not depend on."""
    try:
        return import_module(name)
    except ImportError as error:
        raise ConfigError(
            f"the library {name} is not installed",
            expected="it for what was asked for",
            mend=f"pip install {' '.join(_requirements(extra or name))}",
        ) from error


def pyproj() -> ModuleType:
    """The library pyproj, before ecCodes: loaded after the PROJ of ecCodes' wheel, it ends the process."""
    if "eckitlib" in sys.modules and "pyproj" not in sys.modules:
        raise ConfigError(
            "cfgrib or eccodes imported before pyproj, which then ends the process",
            expected="pyproj first",
            mend="write `import pyproj` above `import cfgrib` (or eccodes), once in a program",
        )
    return import_module("pyproj")


def _requirements(extra: str) -> list[str]:
    """Libraries of an extra, which pip finds on an index that has no descentflow."""
    try:
        every = requires("descentflow") or []
    except PackageNotFoundError:
        every = []
    return [f"'{path.partition(';')[0].strip()}'" for path in every if path.endswith(f'extra == "{extra}"')] or [extra]


def to_pandas(table: pl.DataFrame) -> Any:
    """The table as a `pandas.DataFrame`: missing numbers become NaN, missing texts None; pyarrow is not needed."""
    pandas = optional_library("pandas")
    return pandas.DataFrame({column.name: _pandas_column(column, pandas) for column in table.iter_columns()})


def _pandas_column(column: pl.Series, pandas: Any) -> Any:
    if isinstance(column.dtype, pl.Datetime) and column.dtype.time_zone:
        return pandas.Series(column.dt.replace_time_zone(None).to_numpy()).dt.tz_localize(column.dtype.time_zone)
    if column.dtype.is_numeric() or column.dtype.is_temporal():
        return column.to_numpy()
    return pandas.Series(column.to_list(), dtype=None if column.dtype == pl.Boolean else object)


def is_pandas(table: Any) -> bool:
    """True for a `pandas.DataFrame`; pandas is not imported to find out."""
    return type(table).__name__ == "DataFrame" and type(table).__module__.partition(".")[0] == "pandas"


def is_table(value: Any) -> bool:
    """True for a table in memory: of Polars, pandas, Arrow (pyarrow, DuckDB), or flights of the library traffic."""
    return isinstance(value, pl.DataFrame | pl.LazyFrame) or is_pandas(_flights(value)) or _is_arrow(value)


def held_table(value: Any) -> Any:
    """A table in memory, of any library of :func:`is_table` or xarray, as one of Polars; anything else as it is.

    Named indices of pandas and coordinates of xarray become columns.
    """
    value = _flights(value)
    if isinstance(value, pl.LazyFrame):
        return value.collect()
    if type(value).__name__ == "Dataset" and type(value).__module__.partition(".")[0] == "xarray":
        value = value.to_dataframe()
    if is_pandas(value):
        named = [name for name in value.index.names if name is not None and name not in value.columns]
        return from_pandas(value.reset_index(level=named) if named else value)
    return pl.DataFrame(value) if _is_arrow(value) else value


def _flights(value: Any) -> Any:
    """The table of pandas that a `Traffic` or a `Flight` holds; anything else as it is."""
    return getattr(value, "data", value) if type(value).__module__.startswith("traffic.core") else value


def _is_arrow(value: Any) -> bool:
    """Test for what hands its columns on by Arrow's interface; a column alone does too, and has no columns."""
    columns = hasattr(value, "columns") or hasattr(value, "column_names")
    return hasattr(value, "__arrow_c_stream__") and columns and not isinstance(value, pl.DataFrame)


def from_pandas(table: Any) -> pl.DataFrame:
    """A `pandas.DataFrame` as a polars table without its index; missing values become null.

    Times become UTC, in which those without a time zone are taken to be.
    """
    return pl.DataFrame({str(name): _polars_column(table[name]) for name in table.columns})


def _polars_column(column: Any) -> pl.Series:
    if column.dtype.kind == "M":
        utc = column if column.dt.tz is None else column.dt.tz_convert("UTC").dt.tz_localize(None)
        return pl.Series(utc.to_numpy()).dt.replace_time_zone("UTC")
    if column.dtype.kind in "fiub" and not column.isna().any():
        return pl.Series(column.to_numpy())
    return pl.Series([None if missing else value for value, missing in zip(column, column.isna(), strict=True)])


def to_dataset(
    table: pl.DataFrame, dims: tuple[str, str], variables: Sequence[str], units: Mapping[str, str] | None = None
) -> Any:
    """An `xarray.Dataset` of a table with one row per pair of two columns, NaN where the table has no row."""
    optional_library("xarray")
    numbers = table.select(*dims, pl.col(list(variables)).cast(pl.Float64))
    dataset = to_pandas(numbers).set_index(list(dims)).to_xarray()
    for name in dataset.data_vars.keys() & (units or {}).keys():
        dataset[name].attrs["units"] = (units or {})[name]
    return dataset


def safe_in_spreadsheets(table: pl.DataFrame) -> pl.DataFrame:
    """The table with an apostrophe before texts that a spreadsheet would take for a formula and execute.

    Names of flights and operators are written by strangers. Numbers are left alone, those written as text too.
    """
    changed = []
    for name in (name for name, kind in table.schema.items() if kind == pl.String):
        text = pl.col(name)
        executed = text.str.contains(FORMULA) & text.cast(pl.Float64, strict=False).is_null()
        changed.append(pl.when(executed).then(pl.lit("'") + text).otherwise(text).alias(name))
    marked = {name: f"'{name}" for name in table.columns if re.match(FORMULA, name)}
    return table.with_columns(changed).rename(marked)


FORMULA = r"^[=+\-@\t\r]"
"""First characters of cells that spreadsheets execute."""


def write_table(
    table: pl.DataFrame, path: str | Path, metadata: Mapping[str, str] | None = None, beside: str = ""
) -> None:
    """Write a table as Parquet or CSV (safe in spreadsheets), by the file's extension, whole or not at all."""
    suffix = Path(path).suffix
    if suffix not in (".parquet", ".csv"):
        raise ConfigError(
            f"output {Path(path).name}", expected=f"an extension among .parquet, .csv{beside}", mend="rename the output"
        )
    with whole_file(path) as temporary:
        if suffix == ".parquet":
            table.write_parquet(temporary, metadata=dict(metadata or {}))
        else:
            safe_in_spreadsheets(table).write_csv(temporary)
