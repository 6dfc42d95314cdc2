"""Three kinds of simulator that a caller may mean: a type's nominal descent, a model, or flights of any simulator."""

import re
import zipfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Literal

import polars as pl

from descentflow.core.errors import CheckpointError, ConfigError, DataError
from descentflow.core.tabular import is_pandas
from descentflow.physics.performance_model import PerformanceModel
from descentflow.surveillance.descents.prepared_descents import Descents

Kind = Literal["nominal", "model", "flights"]
DESIGNATOR = re.compile(r"[A-Z][A-Z0-9]{1,3}")
"""Type designators of ICAO Doc 8643: two to four letters and digits, a letter first."""
NAMES = (".ckpt", ".pt", ".pth")
"""Endings of names of checkpoints: a damaged one still is no table of rows."""
EXPECTED = "a checkpoint, or rows or prepared descents of a simulator's flights"


def kind_of(simulator: Any) -> Kind:
    """Kind of a source: a type (``nominal``), a model or its checkpoint (``model``), or flights (``flights``).

    A file is known by its content: a checkpoint is an archive of PyTorch, whatever its name.

    Args:
        simulator: A designator or coefficients; the path of a checkpoint, a density or a fitted model; a path or
            several of rows or prepared descents, or these in memory.

    Raises:
        CheckpointError: If a path that ends like a checkpoint's does not exist.
        ConfigError: If a checkpoint is one of several paths.
        DataError: If another path does not exist.

    Example:
        >>> [kind_of(one) for one in ("A320", "best.ckpt", "rows.parquet", ["rows.parquet", "descents.parquet"])]
        ['nominal', 'model', 'flights', 'flights']
    """
    if isinstance(simulator, PerformanceModel) or is_designator(simulator):
        return "nominal"
    paths = paths_of(simulator)
    if paths:
        return _kind_of_files(paths)
    return "flights" if _are_flights(simulator) else "model"


def paths_of(source: Any) -> list[Path]:
    """The paths that a source is given by; none where it is in memory.

    Example:
        >>> paths_of(["a.parquet", Path("b")]), paths_of(pl.DataFrame())
        ([PosixPath('a.parquet'), PosixPath('b')], [])
    """
    if isinstance(source, str | Path):
        return [Path(source)]
    several = isinstance(source, Sequence) and bool(source) and all(isinstance(one, str | Path) for one in source)
    return [Path(one) for one in source] if several else []


def name_of(source: Any) -> str:
    """Name of a source in reports: the names of its files or folders.

    Example:
        >>> name_of("here/rows.parquet"), name_of(["a.csv", "b.csv", "c.csv"]), name_of(pl.DataFrame())
        ('rows.parquet', 'a.csv + 2 more', 'flights in memory')
        >>> name_of(["a.csv", "b.csv"])
        'a.csv + b.csv'
    """
    paths = paths_of(source)
    if not paths:
        return "flights in memory"
    first, *others = [path.name or path.resolve().name for path in paths[:2]]
    return " + ".join([first, *(others if len(paths) <= 2 else [f"{len(paths) - 1} more"])])


def is_designator(simulator: object) -> bool:
    """Test for a text that is the designator of a type, and not the name of a file.

    Example:
        >>> is_designator("A320"), is_designator("best.ckpt"), is_designator(Path("A320"))
        (True, False, False)
    """
    return isinstance(simulator, str) and DESIGNATOR.fullmatch(simulator) is not None and not Path(simulator).exists()


def is_checkpoint(path: Path) -> bool:
    """Test for a checkpoint by its content, or by its name although it is damaged.

    Example:
        >>> is_checkpoint(Path("best.ckpt")), is_checkpoint(Path("rows.parquet"))
        (True, False)
    """
    if path.is_dir():
        return False
    if zipfile.is_zipfile(path):
        with zipfile.ZipFile(path) as archive:
            if any(name.endswith("data.pkl") for name in archive.namelist()):
                return True
    return path.suffix in NAMES


def _kind_of_files(paths: list[Path]) -> Kind:
    for path in paths:
        if not path.exists():
            error = CheckpointError if path.suffix in NAMES else DataError
            typed = is_designator(path.name)
            mend = f"check the path{', or ask for nominal BADA with typecode (--typecode)' if typed else ''}"
            raise error(f"no file {path}", expected=EXPECTED, mend=mend)
    checkpoints = [path for path in paths if is_checkpoint(path)]
    if checkpoints and len(paths) > 1:
        raise ConfigError(
            f"the checkpoint {checkpoints[0]} among {len(paths)} paths of a simulator",
            expected="one checkpoint alone, or paths of flights",
            mend="diagnose them one by one",
        )
    return "model" if checkpoints else "flights"


def _are_flights(source: Any) -> bool:
    """Test for rows or descents in memory."""
    if isinstance(source, list | tuple):
        return bool(source) and all(_are_flights(one) for one in source)
    tables = pl.DataFrame | pl.LazyFrame
    is_table = is_pandas(source) or isinstance(source, Descents | tables)
    return is_table or isinstance(getattr(source, "rows", None), tables)
