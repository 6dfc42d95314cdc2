"""Request to a target: a model, the number of samples, and where they are flown."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from hashlib import sha256
from pathlib import Path
from typing import Literal

import numpy as np
import polars as pl
from numpy.typing import NDArray

from descentflow.core.errors import ConfigError
from descentflow.densities.density import Density
from descentflow.generation.sample import sample
from descentflow.generation.sample_contexts import Contexts
from descentflow.generation.samples import Samples
from descentflow.positions.ground_plan import NOWHERE, GroundPlan

FIRST_ADDRESS, ADDRESSES = 0xF00000, 0xFFFFF
"""ICAO addresses of samples: a block that no state has, but for its last, which is no address."""


@dataclass(frozen=True)
class ExportRequest:
    """A model, and the wanted export of it.

    Attributes:
        density: The model.
        path: The output.
        n: Number of samples.
        seed: Of the samples.
        context: For a conditional model, as in :func:`descentflow.generation.sample.sample`.
        plan: Where they are flown.
        every_s: Seconds from one flight's arrival to the next one's.
        draw_budget: Most draws.
        progress: Called with the number of descents newly accepted.
        precision: Of the inputs and outputs of a sampler that is exported itself.
        step_s: Seconds from row to row; a row for each level if None.
        prefix: Of the callsigns; if empty, three letters that stand for these flights.
        fly_as: Types that the samples are flown as, in turn; the model's own if empty.
        first: Number of the first flight, where flights of several models are counted on.
        models: How many there are; so far apart are the numbers of this one's flights.

    Example:
        >>> from descentflow.densities.checkpoint import load_model
        >>> request = ExportRequest(load_model("best.ckpt"), Path("samples.parquet"), n=3)
        >>> len(request.samples), request.typecode
        (3, 'A320')
    """

    density: Density
    path: Path
    n: int = 1000
    seed: int = 0
    context: Contexts | None = None
    plan: GroundPlan = NOWHERE
    every_s: float = 120.0
    draw_budget: int | None = None
    progress: Callable[[int], None] | None = None
    precision: Literal["float64", "float32"] = "float64"
    step_s: float | None = None
    prefix: str = ""
    fly_as: tuple[str, ...] = ()
    first: int = 0
    models: int = 1

    @cached_property
    def samples(self) -> Samples:
        """The samples, laid over the ground; drawn when a target first asks for them."""
        drawn = sample(
            self.density,
            self.n,
            seed=self.seed,
            context=self.context,
            draw_budget=self.draw_budget,
            progress=self.progress,
        )
        return replace(drawn, plan=self.plan)

    def beside(self, suffix: str, content: bytes) -> Path:
        """Path of a further file in the output's folder, under its name.

        Args:
            suffix: Of the file.
            content: What will be in it.

        Raises:
            ConfigError: If another file has this name, and no output that it could belong to is there.
        """
        path = self.path.with_suffix(suffix)
        if path.exists() and not self.path.exists() and not (path.is_file() and path.read_bytes() == content):
            raise ConfigError(
                f"{path}, which belongs to something else",
                expected=f"a name that is free, for the file that goes with {self.path.name}",
                mend=f"choose another output than {self.path}, or move {path} away",
            )
        return path

    @property
    def typecode(self) -> str:
        """Type designator of the aircraft."""
        return self.density.representation.decoder.aircraft.typecode

    @property
    def types(self) -> tuple[str, ...]:
        """Type designators that the samples are flown as."""
        return self.fly_as or (self.typecode,)

    @property
    def numbers(self) -> range:
        """Of the flights, among those of all models."""
        return range(self.first, self.first + self.n * self.models, self.models)

    def callsign(self, number: int) -> str:
        """Invented callsign of a flight.

        Example:
            >>> from descentflow.densities.checkpoint import load_model
            >>> ExportRequest(load_model("best.ckpt"), Path("d.scn"), prefix="KLM").callsign(7)
            'KLM00007'
        """
        return f"{self._letters}{number:05d}"

    @cached_property
    def _letters(self) -> str:
        """Begin of the callsigns: other flights in one program need other letters, or one of two is lost."""
        if self.prefix:
            return self.prefix
        entries = self.samples.to_polars().group_by("sample_id", maintain_order=True).first()
        number = _number_of(f"{self.types} {self.every_s:g} {entries.write_csv(float_precision=1)}")
        return "".join(chr(ord("A") + number // 26**place % 26) for place in range(3))

    def flights(self) -> pl.DataFrame:
        """The table of samples as flights of their own: ``flight_id``, ``callsign``, ``icao24`` and ``typecode`` first.

        With a time, the first flight passes the lowest level then, and each of the others ``every_s`` later.

        Example:
            >>> from descentflow.densities.checkpoint import load_model
            >>> flights = ExportRequest(load_model("best.ckpt"), Path("s.parquet"), n=2, prefix="KLM").flights()
            >>> flights["callsign"][-1]
            'KLM00001'
        """
        table = self.samples.to_polars()
        number, first = pl.col("sample_id").cast(pl.Int64), _number_of(self._letters)
        callsigns = [self.callsign(number) for number in self.numbers]
        names = pl.DataFrame({"sample_id": pl.Series(range(self.n), dtype=pl.Int32)}).with_columns(
            flight_id=pl.Series([f"{self.typecode}-{callsign}" for callsign in callsigns]),
            callsign=pl.Series(callsigns),
            icao24=pl.Series([f"{FIRST_ADDRESS + (first + number) % ADDRESSES:06x}" for number in self.numbers]),
            typecode=pl.lit(self.typecode),
        )
        rows = table.join(names, on="sample_id", how="left", maintain_order="left")
        if "timestamp" in rows.columns:
            later = pl.duration(microseconds=(1e6 * self.every_s * number).cast(pl.Int64))
            rows = rows.with_columns(pl.col("timestamp") + later)
        rows = rows.select("sample_id", *names.columns[1:], pl.exclude("sample_id", *names.columns[1:]))
        return rows if self.step_s is None else rows_by_time(rows, self.step_s)


def _number_of(text: str) -> int:
    """Number that stands for a text, the same on every machine."""
    return int(sha256(text.encode()).hexdigest(), 16)


Array = NDArray[np.float64]
ANGLES = {"track": 0.0, "longitude": -180.0}
"""Angles (degrees), and where each begins: between rows they go the shorter way round."""
FEWEST_ROWS = 2
"""Rows of a flight."""


def rows_by_time(table: pl.DataFrame, step_s: float) -> pl.DataFrame:
    """Rows where the clock shows a multiple of a step: UTC if there are timestamps, else the time since entry.

    Programs that resample take the first row of each step for the step's beginning: at odd times it is not.

    Args:
        table: Flights with a row for each level, in the order of time, identified by ``sample_id``.
        step_s: Seconds from row to row.

    Returns:
        The same columns; numbers are interpolated in time, ``level_fl`` too.

    Raises:
        ConfigError: If the step is not above 0, or leaves a flight fewer than two rows.

    Example:
        >>> from descentflow.generation.sample import sample
        >>> rows_by_time(sample("best.ckpt", 2).to_polars(), 5.0)["time_s"][:3].to_list()
        [0.0, 5.0, 10.0]
    """
    if not step_s > 0:
        raise ConfigError(f"rows every {step_s:g} s", expected="above 0 s", mend="pass for instance --step-s 1")
    parts = []
    # Microseconds of UTC are whole numbers: rows fall on the step itself.
    name, step = ("timestamp", 1e6 * step_s) if "timestamp" in table.columns else ("time_s", step_s)
    for rows in table.partition_by("sample_id", maintain_order=True):
        clock = rows[name].to_physical().to_numpy().astype(float)
        times = step * np.arange(np.ceil(clock[0] / step), np.floor(clock[-1] / step) + 1)
        if len(times) < FEWEST_ROWS:
            raise ConfigError(
                f"rows every {step_s:g} s of a descent of {(clock[-1] - clock[0]) * step_s / step:.0f} s",
                expected=f"{FEWEST_ROWS} rows or more of each descent",
                mend="pass for instance --step-s 1",
            )
        parts.append(rows_at(rows, clock, times))
    return pl.concat(parts)


def rows_at(flight: pl.DataFrame, clock: Array, times: Array) -> pl.DataFrame:
    """Rows of one flight at other times.

    Args:
        flight: A row for each level.
        clock: (k,) time of each row, ascending.
        times: (m,) times of the new rows, on the same clock.

    Returns:
        m rows of the same columns; other columns are those of the first row.

    Example:
        >>> from descentflow.generation.sample import sample
        >>> flight = sample("best.ckpt", 1).to_polars()
        >>> rows_at(flight, flight["time_s"].to_numpy(), np.array([10.0, 20.0]))["time_s"].to_list()
        [10.0, 20.0]
    """
    columns: dict[str, pl.Series] = {}
    for name, kind in flight.schema.items():
        if name == "sample_id" or not (kind.is_numeric() or kind.is_temporal()):
            columns[name] = flight[name].head(1).new_from_index(0, len(times))
            continue
        values = flight[name].to_physical().to_numpy().astype(float)
        if name in ANGLES:
            turned = np.interp(times, clock, np.unwrap(values, period=360))
            values = (turned - ANGLES[name]) % 360 + ANGLES[name]
        else:
            values = np.interp(times, clock, values)
        columns[name] = (
            pl.Series(values.round().astype(np.int64)).cast(kind) if kind.is_temporal() else pl.Series(values)
        )
    return pl.DataFrame(columns)
