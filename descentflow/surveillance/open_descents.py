"""Flights as a user gives them: rows are cleaned, prepared files are read, and other settings are not overlooked."""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import polars as pl

from descentflow.core.errors import CleaningError, ConfigError, DataError, warn
from descentflow.core.tabular import held_table, is_table
from descentflow.core.threads import check_not_forked
from descentflow.surveillance.cleaning.thresholds import Cleaning, differences_in_words, different_settings
from descentflow.surveillance.descents._check_descents import checked_descents
from descentflow.surveillance.descents.prepared_descents import Descents, join_descents, read_descents, top_levels
from descentflow.surveillance.descents.store import KEY, MANIFEST, SCHEMA_VERSION
from descentflow.surveillance.unpacking import whole_input

USUAL = Cleaning()
"""The default settings."""


class FlightSource:
    """Rows, or descents that were prepared from rows, in memory or by path: what every command opens flights with.

    Example:
        >>> FlightSource("rows.parquet").descents().cleaning == Cleaning()
        True
        >>> FlightSource("rows.parquet").descents(Cleaning(transient_s=60.0)).cleaning.transient_s
        60.0
    """

    def __init__(
        self, source: Any, columns: Mapping[str, str] | None = None, progress: Callable[[str], None] | None = None
    ) -> None:
        """Read what is prepared; rows are read once their settings are known.

        Args:
            source: A path to rows (a file or a folder), to a prepared file, a store or a folder of prepared files;
                several such paths; descents in memory; a table (Polars or pandas) of prepared descents, which has a
                column `level_fl`, or of rows; simulated flights; or several of these in memory.
            columns: Name in a row -> column of the rows' tables, as `prepare` has it.
            progress: Called with each stage and the settings that rows are cleaned with.

        Raises:
            DataError: If there is nothing there, it cannot be read, or prepared files and others are put together.
        """
        check_not_forked()
        self.source, self.columns, self.say = source, columns or {}, progress or (lambda _: None)
        self.prepared = _prepared(source)

    @property
    def name(self) -> str:
        """Names of its files or folders.

        Example:
            >>> FlightSource(["rows.parquet", "rows.parquet"]).name, FlightSource(pl.DataFrame()).name
            ('rows.parquet + rows.parquet', 'flights in memory')
        """
        paths = paths_of(self.source)
        if not paths:
            return "flights in memory"
        first, *others = [path.name or path.resolve().name for path in paths[:2]]
        return " + ".join([first, *(others if len(paths) <= 2 else [f"{len(paths) - 1} more"])])

    def descents(self, cleaning: Cleaning = USUAL) -> Descents:
        """Prepared descents as they are; rows are cleaned.

        Args:
            cleaning: Settings for rows.

        Raises:
            ConfigError: If columns are named of descents that are prepared.
            DataError: If rows cannot be read or used.
        """
        if not self.prepared:
            differences = different_settings(USUAL, cleaning)
            changed = ", ".join(f"{name} {value}" for name, (_, value) in differences.items())
            self.say(f"cleaning rows with {changed or 'the default settings'}")
            # Here and not above: prepared descents must not pay for the reading of rows.
            from descentflow.surveillance.prepare import prepare

            try:
                return prepare(self.source, cleaning=cleaning, columns=self.columns, progress=self.say)
            except CleaningError as error:  # a diagnosis has flights of two sides
                raise CleaningError(f"{self.name}: {error.got}", expected=error.expected, mend=error.mend) from error
        if self.columns:
            words = ", ".join(f"{name}={column}" for name, column in self.columns.items())
            raise ConfigError(
                f"columns of prepared descents ({words})",
                expected="columns of rows",
                mend="leave them out, for prepared descents have names of their own",
            )
        return self.prepared[0]

    def without_rows(self) -> Descents:
        """Prepared descents; what a model is trained on is prepared knowingly.

        Raises:
            DataError: If it is something else.

        Example:
            >>> FlightSource("descents.parquet").without_rows().frame["flight_id"].n_unique()
            120
        """
        # Of what is not prepared, the reader of prepared files says best what it is.
        if not self.prepared and are_rows(self.source):
            raise DataError(
                "rows that are not prepared", expected="prepared descents", mend="pass what descentflow.prepare returns"
            )
        return self.prepared[0] if self.prepared else read_descents(paths_of(self.source)[0])

    def for_model(self, cleaning: Cleaning | None, lowest_fl: float) -> Descents:
        """Descents that a model is compared with; rows are cleaned with the settings of its training descents.

        Args:
            cleaning: Those settings; None where the model does not know them. Then rows are cleaned with the defaults.
            lowest_fl: Lowest level of the model's grid.

        Raises:
            ConfigError: As :meth:`descents`.
            DataError: As :meth:`descents`.

        Warns:
            DescentflowWarning: If the settings of either are unknown, or differ.

        Example:
            >>> from descentflow.densities.checkpoint import load_model
            >>> kept = load_model("best.ckpt").representation.cleaning
            >>> FlightSource("rows.parquet").for_model(kept, 150).cleaning == kept
            True
        """
        if cleaning is None:
            warn(
                "the cleaning settings of this model's training descents are unknown: rows are cleaned with the "
                "default settings, and prepared descents are taken as they are; fit the model again to have it keep "
                "its settings"
            )
            return self.descents(Cleaning(bottom_fl=int(lowest_fl)))
        for prepared in self.prepared:
            _compare_settings(
                {"the model's training descents": cleaning, "these descents": prepared.cleaning},
                "prepare the rows with the model's settings, or pass the rows themselves",
            )
        return self.descents(cleaning)

    def beside(self, simulator: "FlightSource") -> tuple[Descents, Descents]:
        """Real descents and those of a simulator, through the same cleaning.

        Rows of either side are cleaned with the settings of the other side's prepared descents; with the default
        settings where both are rows. Prepared descents are taken as they are.

        Raises:
            ConfigError: As :meth:`descents`.
            DataError: As :meth:`descents`.

        Warns:
            DescentflowWarning: If both are prepared and were cleaned with different settings, each of which is named;
                or if the settings of either are unknown.

        Example:
            >>> real, simulator = FlightSource("rows.parquet").beside(FlightSource("descents.parquet"))
            >>> real.cleaning == simulator.cleaning, real.frame.equals(simulator.frame)
            (True, True)
        """
        sides = {"the real descents": self.prepared, "the simulator's descents": simulator.prepared}
        prepared = {name: part for name, held in sides.items() for part in held}
        _compare_settings(
            {name: one.cleaning for name, one in prepared.items()},
            "prepare the rows of both with the same settings, or pass the rows themselves",
        )
        last_first = [*prepared.values()][::-1]
        known = [part.cleaning for part in last_first if part.cleaning is not None]
        # Of settings that are unknown, the lowest level at least shows in the descents.
        settings = [*known, *(Cleaning(bottom_fl=part.bottom_fl) for part in last_first), USUAL][0]
        return self.descents(settings), simulator.descents(settings)


def is_prepared(path: Path) -> bool:
    """Test for the path of a prepared file or a store, and not of rows."""
    if path.is_dir():
        return (path / MANIFEST).is_file()
    if path.suffix != ".parquet" or not path.is_file():
        return False
    with whole_input(path, "a whole Parquet file", "write it again"):
        return KEY in pl.read_parquet_metadata(path)


def paths_of(source: Any) -> list[Path]:
    """The paths that a source is given by; none where it is in memory.

    Example:
        >>> paths_of(["a.parquet", Path("b")]), paths_of(pl.DataFrame())
        ([PosixPath('a.parquet'), PosixPath('b')], [])
    """
    if isinstance(source, str | Path):
        return [Path(source)]
    several = isinstance(source, Sequence) and bool(source) and all(isinstance(file, str | Path) for file in source)
    return [Path(file) for file in source] if several else []


def are_rows(source: Any) -> bool:
    """Test for rows in memory: a table, several, or what ``simulate`` returned."""
    if isinstance(source, list | tuple):
        return bool(source) and all(are_rows(file) for file in source)
    return is_table(source) or is_table(getattr(source, "rows", None))


def _prepared(source: Any) -> tuple[Descents, ...]:
    """Descents that are prepared already, joined; empty for rows."""
    descents = _in_memory(source)
    if descents or are_rows(source):
        return descents
    paths = _expanded(_existing(source))
    prepared = [path for path in paths if is_prepared(path)]
    if not prepared:
        return ()
    if len(prepared) < len(paths):
        other = next(path for path in paths if path not in prepared)
        raise DataError(
            f"prepared descents ({prepared[0]}) and others ({other}) together",
            expected="rows alone, or prepared descents alone",
            mend="prepare the rows first",
        )
    return (join_descents([read_descents(path) for path in prepared], [str(path) for path in prepared]),)


def _existing(source: Any) -> list[Path]:
    paths = paths_of(source)
    if not paths:
        raise DataError(
            f"an object of type {type(source).__name__} for descents",
            expected="a path, several paths, Descents, or a table of prepared descents",
            mend="pass what descentflow.prepare returned, or the path of rows or of a prepared file",
        )
    for path in paths:
        if not path.exists():
            raise DataError(f"no file {path}", expected="rows or prepared descents", mend="check the path")
    return paths


def _expanded(paths: Sequence[Path]) -> list[Path]:
    """The prepared files of a folder in place of the folder; a folder without any stands for itself."""
    prepared: list[Path] = []
    for path in paths:
        parquet = [] if not path.is_dir() or is_prepared(path) else sorted(path.glob("*.parquet"))
        inside = [file for file in parquet if not file.name.startswith(".")]  # hidden: what a killed run left
        prepared += inside if any(is_prepared(file) for file in inside) else [path]
    return prepared


def _in_memory(source: Any) -> tuple[Descents, ...]:
    if isinstance(source, Descents):
        return (source,)
    if isinstance(source, list | tuple) and source:
        whole = [held for file in source for held in _in_memory(file)]
        names = [f"table {number}" for number in range(1, len(source) + 1)]
        return (join_descents(whole, names),) if len(whole) == len(source) else ()
    table = held_table(source)
    if not isinstance(table, pl.DataFrame) or "level_fl" not in table.columns:
        return ()
    table = checked_descents(table, "a table of descents")
    bottom = int(table["level_fl"].min())  # type: ignore[arg-type]
    known = {"schema_version": SCHEMA_VERSION, "bottom_fl": bottom, "top_fl": top_levels(table), "inputs": []}
    return (Descents(table, known),)


def _compare_settings(settings: Mapping[str, Cleaning | None], mend: str) -> None:
    """Warn of sides that were cleaned with different settings, or that do not say with which."""
    known = {name: cleaning for name, cleaning in settings.items() if cleaning is not None}
    unknown = [name for name in settings if name not in known]
    if unknown:
        doubt = f"the cleaning settings of {' and '.join(unknown)} are unknown and may differ from the other side's"
    elif words := differences_in_words(known):
        doubt = f"descents of different cleaning settings: {words}"
    else:
        return
    warn(f"{doubt}; what the settings change shows as a difference of flight; {mend}")
