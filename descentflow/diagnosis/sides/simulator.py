"""Simulators to diagnose: a model, flights of any simulator, or a type's nominal descent; what suits each."""

import re
import zipfile
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import polars as pl

from descentflow.core.errors import CheckpointError, ConfigError, DataError
from descentflow.diagnosis.findings.inputs_found import CoefficientsUsed
from descentflow.physics.performance_model import PerformanceModel
from descentflow.surveillance.cleaning.thresholds import Cleaning
from descentflow.surveillance.descents.prepared_descents import Descents
from descentflow.surveillance.open_descents import are_rows, paths_of

if TYPE_CHECKING:
    from descentflow.densities.density import Density
    from descentflow.representation.representation import Representation

FLIGHTS, MODEL, TYPE = "flights", "a checkpoint", "a type"
"""Kinds of simulators."""
DESIGNATOR = re.compile(r"[A-Z][A-Z0-9]{1,3}")
"""Type designators of ICAO Doc 8643: two to four letters and digits, a letter first."""
MODEL_NAME = re.compile(r"[\w-]+")
"""Names of models of BADA 4, such as A320-231; names of files have a dot."""
CHECKPOINT_SUFFIXES = (".ckpt", ".pt", ".pth")
"""Endings of names of checkpoints: a damaged one still is no table of rows."""
MIN_LEVELS_FL = 30.0
"""Height of the levels that both sides show: six bands of 500 ft, the least that has a shape in altitude."""


@dataclass(frozen=True)
class Simulator:
    """Simulator to diagnose: a model, flights of any simulator, or nominal BADA.

    Attributes:
        aircraft: Coefficients that give the signatures of effects.
        name: For readers.
        flights: Prepared descents of the simulator, where it is given by its flights.
        model: Density, where it is a model.
        path: Its checkpoint, if it was read from one.
        coefficients: Source of the coefficients, where it is given by its flights or any type of flights is taken.

    Example:
        >>> from descentflow.aircraft_types.registry import aircraft
        >>> Simulator(aircraft("A320")).name
        'nominal'
    """

    aircraft: PerformanceModel
    name: str = "nominal"
    flights: Descents | None = None
    model: "Density | None" = None
    path: Path | None = None
    coefficients: CoefficientsUsed | None = None

    @property
    def representation(self) -> "Representation | None":
        """Representation of a model's flights."""
        return None if self.model is None else self.model.representation

    @property
    def cleaning(self) -> Cleaning:
        """Settings by which its flights were cleaned; the defaults where they are not known."""
        return (None if self.flights is None else self.flights.cleaning) or Cleaning()

    def content(self) -> dict[str, Any]:
        """Content of a model's checkpoint, read again."""
        from descentflow.densities.checkpoint import content_of
        from descentflow.representation.read_checkpoint import read_checkpoint

        assert self.model is not None
        return content_of(self.model) if self.path is None else read_checkpoint(self.path)

    def levels(self, frame: pl.DataFrame) -> tuple[float, float]:
        """Lowest and highest level of its grid.

        Args:
            frame: Prepared real descents.

        Raises:
            DataError: If flights of the simulator and real ones have too few levels in common.
        """
        if self.representation is not None:
            levels = self.representation.decoder.levels_fl
            return float(levels[0]), float(levels[-1])
        if self.flights is None:
            return _levels_of(frame)
        low, high = _levels_of(self.flights.frame)
        lowest, highest = (
            float(bound) for bound in frame.select(low=pl.min("level_fl"), high=pl.max("level_fl")).row(0)
        )
        common = max(low, lowest), min(high, highest)
        if common[1] - common[0] < MIN_LEVELS_FL:
            raise DataError(
                f"real flights between FL{lowest:.0f} and FL{highest:.0f}, and a simulator's between FL{low:.0f} and "
                f"FL{high:.0f}",
                expected=f"levels that both have, over {100 * MIN_LEVELS_FL:,.0f} ft at least",
                mend="prepare both with one --bottom-fl, and let the simulator fly the levels of the real flights",
            )
        return common

    def of_its_type(self, frame: pl.DataFrame) -> tuple[pl.DataFrame, dict[str, int]]:
        """Real flights of a checkpoint's or a nominal descent's type, and how many there were of each other type.

        Args:
            frame: Prepared descents; all are kept if they name no type.

        Raises:
            DataError: If none is of its type.

        Example:
            >>> from descentflow.aircraft_types.registry import aircraft
            >>> frame = pl.read_parquet("descents.parquet")
            >>> own = pl.format("other {}", "flight_id")
            >>> other = frame.with_columns(typecode=pl.lit("B738"), flight_id=own)
            >>> kept, dropped = Simulator(aircraft("A320")).of_its_type(pl.concat([frame, other]))
            >>> len(kept) == len(frame), dropped
            (True, {'flights_of_B738': 120})
        """
        if "typecode" not in frame.columns:
            return frame, {}
        representation = self.representation
        known = {
            self.aircraft.typecode,
            *([] if representation is None else representation.provenance.get("typecodes", [])),
        }
        flights = frame.group_by("typecode").agg(pl.col("flight_id").n_unique()).drop_nulls().sort("typecode")
        given = {str(name): int(number) for name, number in flights.iter_rows()}
        if given and not given.keys() & known:
            raise DataError(
                f"descents of {', '.join(given)} for a simulator of {', '.join(sorted(known))}",
                expected="flights of the simulator's type",
                mend="choose the flights, or a simulator of their type; --any-type takes them all the same",
            )
        kept = frame.filter(pl.col("typecode").is_in(known) | pl.col("typecode").is_null())
        return kept, {f"flights_of_{name}": number for name, number in given.items() if name not in known}


def types_of(frame: pl.DataFrame) -> list[str]:
    """Types that prepared descents name, sorted.

    Example:
        >>> types_of(pl.read_parquet("descents.parquet"))
        ['A320']
    """
    return sorted(frame["typecode"].drop_nulls().cast(pl.String).unique().to_list()) if "typecode" in frame else []


def _levels_of(frame: pl.DataFrame) -> tuple[float, float]:
    """Lowest level, and the highest that a quarter of the flights reach."""
    reached = frame.group_by("flight_id").agg(pl.col("level_fl").max())["level_fl"].to_numpy()
    lowest = frame["level_fl"].to_numpy().min(initial=10_000)
    top = sorted(reached.tolist(), reverse=True)[max(len(reached) // 4 - 1, 0)] if len(reached) else lowest
    return float(lowest), float(max(top, lowest + 20))


def kind_of_simulator(simulator: Any, bada_dir: str | Path | None = None) -> str:
    """Kind of what a user gives as a simulator: a type, flights or a checkpoint (which a model in memory counts as).

    A type is an aircraft, its designator, or a model's name in a folder of BADA 4, where no file has that name. Flights
    are known by the content of files.

    Raises:
        CheckpointError: If there is no such checkpoint.
        ConfigError: If there is a checkpoint among several paths.
        DataError: If there is no such file.

    Example:
        >>> [kind_of_simulator(one) for one in ("A320", "descents.parquet", "best.ckpt")]
        ['a type', 'flights', 'a checkpoint']
        >>> kind_of_simulator("A320-231", "bada")
        'a type'
    """
    if isinstance(simulator, PerformanceModel):
        return TYPE
    named = DESIGNATOR if bada_dir is None else MODEL_NAME
    if isinstance(simulator, str) and named.fullmatch(simulator) and not Path(simulator).exists():
        return TYPE
    paths = paths_of(simulator)
    if not paths:
        several = simulator if isinstance(simulator, list | tuple) else [simulator]
        rows = bool(several) and all(isinstance(one, Descents) or are_rows(one) for one in several)
        return FLIGHTS if rows else MODEL
    for path in paths:
        if not path.exists():
            error = CheckpointError if path.suffix in CHECKPOINT_SUFFIXES else DataError
            typed = MODEL_NAME.fullmatch(str(path))
            raise error(
                f"no file {path}",
                expected="a checkpoint, or rows or prepared descents of a simulator's flights",
                mend=f"check the path{', or ask for nominal BADA with typecode (--typecode)' if typed else ''}",
            )
    checkpoints = [path for path in paths if _is_checkpoint(path)]
    if checkpoints and len(paths) > 1:
        raise ConfigError(
            f"the checkpoint {checkpoints[0]} among {len(paths)} paths of a simulator",
            expected="one checkpoint alone, or paths of flights",
            mend="diagnose them one by one",
        )
    return MODEL if checkpoints else FLIGHTS


def _is_checkpoint(path: Path) -> bool:
    """Test for a checkpoint by its content, or by its name although it is damaged."""
    if path.is_dir():
        return False
    if zipfile.is_zipfile(path):
        with zipfile.ZipFile(path) as archive:
            if any(name.endswith("data.pkl") for name in archive.namelist()):
                return True
    return path.suffix in CHECKPOINT_SUFFIXES
