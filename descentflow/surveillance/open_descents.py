"""Descents of whatever a user has: rows are cleaned, prepared files are read, and other settings are not overlooked."""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import polars as pl

from descentflow.core.arguments import checked_arguments
from descentflow.core.errors import ConfigError, DataError, warn
from descentflow.core.tabular import held_table, is_pandas
from descentflow.surveillance.cleaning.thresholds import Cleaning, differences_in_words, different_settings
from descentflow.surveillance.descents.check_descents import checked_descents
from descentflow.surveillance.descents.prepared_descents import (
    Descents,
    join_descents,
    read_descents,
    top_levels,
)
from descentflow.surveillance.descents.store import KEY, MANIFEST, SCHEMA_VERSION
from descentflow.surveillance.unpacking.streams import whole_input

Say = Callable[[str], None]


@checked_arguments
def open_descents(
    source: Any,
    cleaning: Cleaning | None = None,
    *,
    rows_cleaning: Cleaning | None = None,
    columns: Mapping[str, str] | None = None,
    progress: Say | None = None,
) -> Descents:
    """Descents of rows or of what was prepared from them, in memory or as a path.

    Args:
        source: A path to rows (a file or a folder), to a prepared file, a store or a folder of prepared files; several
            such paths; descents in memory; a table (Polars or pandas) of prepared descents, which has a column
            `level_fl`, or of rows; simulated flights; or several of these in memory.
        cleaning: Settings that the descents must have: rows are cleaned with them, and of prepared descents that were
            cleaned with others a warning names every setting that differs. None if any will do.
        rows_cleaning: Settings for rows where ``cleaning`` is None; the defaults if absent.
        columns: Name in a row -> column of the rows' tables, as `prepare` has it.
        progress: Progress callback, called with each stage and the settings that rows are cleaned with.

    Raises:
        ConfigError: If columns are named of descents that are prepared.
        DataError: If there is nothing there, it cannot be read, or prepared files of different settings are put
            together.

    Warns:
        DescentflowWarning: If descents were prepared with other settings than ``cleaning``, or do not say with which.

    Example:
        >>> open_descents("rows.parquet").cleaning == Cleaning()
        True
        >>> open_descents("rows.parquet", Cleaning(transient_s=60.0)).cleaning.transient_s
        60.0
    """
    descents = prepared_descents(source)
    if descents is not None and cleaning is not None:
        _compare_settings(
            {"the model's training descents": cleaning, "these descents": descents.cleaning},
            "prepare the rows with the model's settings, or pass the rows themselves",
        )
    return _cleaned(source, descents, cleaning or rows_cleaning or Cleaning(), columns, progress)


@checked_arguments
def open_prepared(source: Any) -> Descents:
    """As :func:`open_descents`, but rows are refused: what a model is trained on is prepared knowingly.

    Args:
        source: A path to a prepared file, a store or a folder of prepared files; several such paths; descents in
            memory; or a table (Polars or pandas) of prepared descents.

    Raises:
        DataError: If it is something else, cannot be read, or was prepared with different settings.

    Example:
        >>> open_prepared("descents.parquet").frame["flight_id"].n_unique()
        120
    """
    descents = prepared_descents(source)
    # Of what is not prepared, the reader of prepared files says best what it is.
    if descents is None and _are_rows(source):
        raise DataError(
            "rows that are not prepared", expected="prepared descents", mend="pass what descentflow.prepare returns"
        )
    return read_descents(_paths(source)[0]) if descents is None else descents


def is_prepared(path: Path) -> bool:
    """Test for the path of a prepared file or a store, and not of rows."""
    if path.is_dir():
        return (path / MANIFEST).is_file()
    if path.suffix != ".parquet" or not path.is_file():
        return False
    with whole_input(path, "a whole Parquet file", "write it again"):
        return KEY in pl.read_parquet_metadata(path)


def prepared_descents(source: Any) -> Descents | None:
    """Descents that are prepared already; None for rows."""
    descents = _in_memory(source)
    if descents is not None or _are_rows(source):
        return descents
    paths = _expanded(_paths(source))
    prepared = [path for path in paths if is_prepared(path)]
    if not prepared:
        return None
    if len(prepared) < len(paths):
        other = next(path for path in paths if path not in prepared)
        raise DataError(
            f"prepared descents ({prepared[0]}) and others ({other}) together",
            expected="rows alone, or prepared descents alone",
            mend="prepare the rows first",
        )
    return join_descents([read_descents(path) for path in prepared], [str(path) for path in prepared])


def _paths(source: Any) -> list[Path]:
    several = [source] if isinstance(source, str | Path) else source
    if not isinstance(several, Sequence) or not several or not all(isinstance(one, str | Path) for one in several):
        raise DataError(
            f"an object of type {type(source).__name__} for descents",
            expected="a path, several paths, Descents, or a table of prepared descents",
            mend="pass what descentflow.prepare returned, or the path of rows or of a prepared file",
        )
    paths = [Path(one) for one in several]
    for path in paths:
        if not path.exists():
            raise DataError(f"no file {path}", expected="rows or prepared descents", mend="check the path")
    return paths


def _expanded(paths: Sequence[Path]) -> list[Path]:
    """The prepared files of a folder in place of the folder; a folder without any stands for itself."""
    found: list[Path] = []
    for path in paths:
        parquet = [] if not path.is_dir() or is_prepared(path) else sorted(path.glob("*.parquet"))
        inside = [one for one in parquet if not one.name.startswith(".")]  # hidden: what a killed run left
        found += inside if any(is_prepared(one) for one in inside) else [path]
    return found


def _are_rows(source: Any) -> bool:
    """Test for rows in memory: a table, several, or what ``simulate`` returned."""
    if isinstance(source, list | tuple):
        return bool(source) and all(_are_rows(one) for one in source)
    tables = pl.DataFrame | pl.LazyFrame
    return is_pandas(source) or isinstance(source, tables) or isinstance(getattr(source, "rows", None), tables)


def _in_memory(source: Any) -> Descents | None:
    if isinstance(source, Descents):
        return source
    if isinstance(source, list | tuple) and source:
        held = [_in_memory(one) for one in source]
        whole = [one for one in held if one is not None]
        names = [f"table {number}" for number in range(1, len(held) + 1)]
        return join_descents(whole, names) if len(whole) == len(held) else None
    table = held_table(source)
    if not isinstance(table, pl.DataFrame) or "level_fl" not in table.columns:
        return None
    table = checked_descents(table, "a table of descents")
    bottom = int(table["level_fl"].min())  # type: ignore[arg-type]
    known = {"schema_version": SCHEMA_VERSION, "bottom_fl": bottom, "top_fl": top_levels(table), "inputs": []}
    return Descents(table, known)


def _cleaned(
    source: Any,
    prepared: Descents | None,
    cleaning: Cleaning,
    columns: Mapping[str, str] | None,
    progress: Say | None,
) -> Descents:
    """Prepared descents as they are, or rows cleaned to descents; progress names settings that are not the defaults."""
    if prepared is None:
        differences = different_settings(Cleaning(), cleaning)
        changed = ", ".join(f"{name} {value}" for name, (_, value) in differences.items())
        say = progress or (lambda _: None)
        say(f"cleaning rows with {changed or 'the default settings'}")
        # Here and not above: prepared descents must not pay for the reading of rows.
        from descentflow.surveillance.prepare import prepare

        return prepare(source, cleaning=cleaning, columns=columns, progress=say)
    if columns:
        words = ", ".join(f"{name}={column}" for name, column in columns.items())
        raise ConfigError(
            f"columns of prepared descents ({words})",
            expected="columns of rows",
            mend="leave them out, for prepared descents have names of their own",
        )
    return prepared


SIDES = ("the real descents", "the simulator's descents")
"""Names of the two sides in warnings."""


def open_pair(
    real: Any,
    simulator: Any,
    *,
    columns: Mapping[str, str] | None = None,
    simulator_columns: Mapping[str, str] | None = None,
    progress: Say | None = None,
) -> tuple[Descents, Descents]:
    """Open real descents and those of a simulator, through the same cleaning.

    Rows of either side are cleaned with the settings of the other side's prepared descents; with the default settings
    where both are rows. Prepared descents are taken as they are.

    Args:
        real: As :func:`~descentflow.surveillance.open_descents.open_descents` takes it.
        simulator: The same, of the simulator.
        columns: Name in a row -> column of the real rows' tables.
        simulator_columns: The same of the simulator's rows.
        progress: Called with what is being done.

    Raises:
        ConfigError: If columns are named of descents that are prepared.
        DataError: If either cannot be read or used.

    Warns:
        DescentflowWarning: If both are prepared and were cleaned with different settings, each of which is named; or if
            the settings of either are unknown.

    Example:
        >>> real, simulator = open_pair("rows.parquet", "descents.parquet")
        >>> real.cleaning == simulator.cleaning, real.frame.equals(simulator.frame)
        (True, True)
    """
    found = prepared_descents(real), prepared_descents(simulator)
    prepared = {name: one for name, one in zip(SIDES, found, strict=True) if one is not None}
    _compare_settings(
        {name: one.cleaning for name, one in prepared.items()},
        "prepare the rows of both with the same settings, or pass the rows themselves",
    )
    settings = _settings_for_rows([*prepared.values()][::-1])
    return (
        _cleaned(real, found[0], settings, columns, progress),
        _cleaned(simulator, found[1], settings, simulator_columns, progress),
    )


def _settings_for_rows(prepared: Sequence[Descents]) -> Cleaning:
    """Settings of the first prepared descents that know them; else the defaults."""
    known = [one.cleaning for one in prepared if one.cleaning is not None]
    # Of settings that are unknown, the lowest level at least shows in the descents.
    return [*known, *(Cleaning(bottom_fl=one.bottom_fl) for one in prepared), Cleaning()][0]


def _compare_settings(settings: Mapping[str, Cleaning | None], mend: str) -> None:
    """Warn of sides that were cleaned with different settings, or that do not say with which."""
    unknown = [name for name, cleaning in settings.items() if cleaning is None]
    known = {name: cleaning for name, cleaning in settings.items() if cleaning is not None}
    if unknown:
        found = f"the cleaning settings of {' and '.join(unknown)} are unknown and may differ from the other side's"
    elif words := differences_in_words(known):
        found = f"descents of different cleaning settings: {words}"
    else:
        return
    text = f"{found}; what the settings change shows as a difference of flight; {mend}"
    warn(text)
