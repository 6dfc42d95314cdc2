"""A world: flights of known truth, and the surveillance rows that a radar would have of them."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from dataclasses import field as dataclass_field
from pathlib import Path
from typing import Any

import polars as pl

from descentflow.aircraft_types.registry import aircraft as find_aircraft
from descentflow.core.arguments import Count, NotNegativeFloat, NotNegativeInt, Output, checked_arguments
from descentflow.core.errors import ConfigError
from descentflow.core.files import check_output, whole_file
from descentflow.core.tabular import to_pandas
from descentflow.core.threads import check_not_forked
from descentflow.physics.performance_model import PerformanceModel
from descentflow.simulation._plain_adsb import check_common_air, plain_adsb
from descentflow.simulation.causes._injection import Injection
from descentflow.simulation.flight import fly
from descentflow.simulation.observe import observe
from descentflow.simulation.parameters import FlightParameters, draw_parameters
from descentflow.simulation.plantable import Values
from descentflow.simulation.scenarios import PLAIN, scenario_settings
from descentflow.simulation.truth import flights_table, name_flights, truth_table
from descentflow.simulation.world_config import WorldConfig, default_operators

CHUNK = 2000
"""Flights flown together: fewer waste time on overhead, more on memory and on waiting for the longest."""


def world_files(out: str | Path, truth: str | Path | None = None) -> tuple[Path, Path, Path]:
    """Paths of a world's rows, flights and truth, checked before minutes of flying go into them.

    Args:
        out: Of the rows, ``NAME.parquet``.
        truth: Of the truth; ``NAME_truth.parquet`` if not given.

    Raises:
        ConfigError: If a name does not end in .parquet, or two are the same.
        DataError: If one cannot be written.

    Example:
        >>> [path.name for path in world_files("rows.parquet")]
        ['rows.parquet', 'rows_flights.parquet', 'rows_truth.parquet']
    """
    rows = Path(out)
    flights, beside = (rows.parent / f"{rows.stem}_{name}.parquet" for name in ("flights", "truth"))
    paths = rows, flights, beside if truth is None else Path(truth)
    if any(path.suffix != ".parquet" for path in paths) or len(set(paths)) < len(paths):
        raise ConfigError(
            f"outputs {', '.join(map(str, paths))}",
            expected="three different names that end in .parquet",
            mend="choose other names for --out and --truth",
        )
    for path in paths:
        check_output(path)
    return paths


def field_file(out: str | Path) -> Path:
    """Path of the weather field of a world's rows.

    Example:
        >>> field_file("rows.parquet").name
        'rows_field.nc'
    """
    return Path(out).with_name(f"{Path(out).stem}_field.nc")


@dataclass(frozen=True)
class World:
    """Simulated flights: what a radar reports of them, and the truth behind it.

    Attributes:
        rows: Surveillance reports in the package's row schema, one row per report.
        flights: One row per flight: every parameter that was drawn, see
            :func:`~descentflow.simulation.truth.flights_table`.
        truth: One row per flight and time step, see :func:`~descentflow.simulation.truth.truth_table`.
        scenario: Name of the settings.
        seed: Of all random numbers.
        planted: Effects that were planted, with all of their values.
        field: Weather field of rows without airspeeds (`xarray.Dataset`); None of others.

    Example:
        >>> names = ("rows.parquet", "rows_flights.parquet", "rows_truth.parquet")
        >>> print(World(*map(pl.read_parquet, names)))
        120 flights of A320, scenario plain, seed 0: ... rows; level-offs planned for ..., constant-rate stretches for
        ... flights
    """

    rows: pl.DataFrame
    flights: pl.DataFrame
    truth: pl.DataFrame
    scenario: str = PLAIN
    seed: int = 0
    planted: Mapping[str, Values] = dataclass_field(default_factory=dict)
    field: Any = None

    def __str__(self) -> str:
        """One line: flights, rows, how many flights leave idle descent on purpose, and what was planted."""
        level_offs, managed = (int(self.flights[c].is_not_null().sum()) for c in ("level_off_fl", "managed_fl"))
        return (
            f"{len(self.flights)} flights of {', '.join(self.flights['typecode'].unique())}, scenario {self.scenario}, "
            f"seed {self.seed}: {len(self.rows)} rows; level-offs planned for {level_offs}, constant-rate stretches "
            f"for {managed} flights{self._planted()}"
        )

    def _planted(self) -> str:
        """Planted causes, in the words of the command line."""
        words = [
            f"{name} ({', '.join(f'{value}={number:g}' for value, number in values.items())})"
            for name, values in self.planted.items()
        ]
        return f"; planted: {', '.join(words)}" if words else ""

    def __repr__(self) -> str:
        """As printed: the tables are too long for a prompt."""
        return f"<World of {self}>"

    def to_polars(self) -> pl.DataFrame:
        """The rows, as ``prepare`` takes them."""
        return self.rows

    def to_pandas(self) -> Any:
        """The rows as a pandas DataFrame.

        Raises:
            ConfigError: If pandas is not installed.
        """
        return to_pandas(self.rows)

    @checked_arguments
    def write(self, out: Output, truth: Output | None = None) -> tuple[Path, Path, Path]:
        """Write rows, truth and flights as Parquet, each file whole or not at all.

        Args:
            out: The rows, ``NAME.parquet``; the flights go to ``NAME_flights.parquet`` next to it, and a field to
                ``NAME_field.nc``.
            truth: The truth; ``NAME_truth.parquet`` if not given.

        Returns:
            The paths of rows, flights and truth.

        Raises:
            ConfigError: If a name does not end in .parquet, two are the same, or a folder does not exist.
        """
        paths = world_files(out, truth)
        for frame, path in zip((self.rows, self.flights, self.truth), paths, strict=True):
            with whole_file(path) as temporary:
                frame.write_parquet(temporary)
        if self.field is not None:
            with whole_file(field_file(out)) as temporary:
                self.field.to_netcdf(temporary)
        return paths


@checked_arguments
def simulate(
    aircraft: PerformanceModel | str,
    n_flights: Count,
    seed: NotNegativeInt = 0,
    scenario: str | Path | WorldConfig | None = None,
    *,
    bada_dir: str | Path | None = None,
    plant: Mapping[str, Values] | None = None,
    inject: Callable[[FlightParameters], FlightParameters] | None = None,
    out: Output | None = None,
    truth_out: Output | None = None,
    without_airspeeds: bool = False,
    wind_error_mps: NotNegativeFloat = 2.5,
    chunk: Count = CHUNK,
    progress: Callable[[int], object] | None = None,
) -> World:
    """Fly descents of one aircraft type by the full equation of motion, and observe them as Mode S does.

    Args:
        aircraft: Type designator (``"A320"``), or the coefficients of a type as floats.
        n_flights: Flights wanted, at least one.
        seed: Not negative; flight number k of a seed is the same in every world that has it.
        scenario: Spreads and shares from which flights are drawn: ``plain``, ``london-fir-2019``, ``gulf-summer``,
            ``nordic-winter``, a TOML file of the same form, or settings of your own; ``plain`` if not given.
        bada_dir: Folder of BADA 3 or 4 with the type's coefficients; the open aircraft that come with descentflow if
            not given. Only for a type designator.
        plant: Effects to plant in the flights: some of the values of each by its name, all of them defaults where it
            has none. They are those of :data:`descentflow.simulation.plantable.PLANTABLE`, which
            ``descentflow simulate --help`` lists. What each flight has got of them stands in ``flights``.
        inject: Changes the parameters of each chunk of flights before they are flown, after what is planted: the place
            for an effect of your own. It sees flights chunk by chunk, so to keep results free of the chunk it must act
            on each flight by itself.
        out: Write the world there too, see :meth:`World.write`; names are checked before anything is flown.
        truth_out: Where ``out`` puts the truth.
        without_airspeeds: Leave IAS, Mach, TAS and heading out of the rows, as plain ADS-B does. Each day has a wind
            then, and the world a ``field`` of it, with errors, to derive them by.
        wind_error_mps: Standard error of each component of the field's wind; its temperature errs by 0.4 K for each
            m/s.
        chunk: Flights flown together; without effect on the result.
        progress: Called with the number of flights just finished.

    Returns:
        The world.

    Raises:
        ConfigError: If the count or the seed cannot be, there is no such scenario, the output cannot be written, or the
            aircraft does not descend, or there is no such effect or value to plant, or it cannot be flown, or rows
            without airspeeds are asked of a world in which flights have an air of their own.
        AircraftError: If there is no such type.

    Example:
        >>> world = simulate("A320", 2, seed=0, out="two.parquet")
        >>> world.flights["flight_id"].to_list(), world.truth["label"].unique(maintain_order=True).to_list()
        (['A320-0-00000', 'A320-0-00001'], ['transient', 'idle'])
        >>> pl.read_parquet("two.parquet").equals(world.rows)
        True
        >>> warm = simulate("A320", 2, seed=0, plant={"temperature": {"deviation_k": 10.0, "spread_k": 2.0}})
        >>> warm.flights.select("planted_temperature_deviation_k", "deviation_k").row(0)
        (14.8..., 14.8...)
    """
    check_not_forked()
    if out is not None:
        world_files(out, truth_out)
    kind = find_aircraft(aircraft, bada_dir) if isinstance(aircraft, str) else aircraft
    config = scenario if isinstance(scenario, WorldConfig) else scenario_settings(str(scenario or PLAIN), kind)
    if without_airspeeds:
        check_common_air(config)
        if out is not None:
            check_output(field_file(out))
    planting = Injection(kind, plant or {}, seed)

    def change(parameters: FlightParameters) -> FlightParameters:
        parameters = planting(parameters)
        return parameters if inject is None else inject(parameters)

    parts = []
    for first in range(0, n_flights, chunk):
        numbers = range(first, min(first + chunk, n_flights))
        parts.append(_chunk(kind, numbers, seed, config, change))
        if progress is not None:
            progress(len(numbers))
    rows, flights, truth = (pl.concat(tables) for tables in zip(*parts, strict=True))
    name = "of your own" if isinstance(scenario, WorldConfig) else str(scenario or PLAIN)
    weather = None
    if without_airspeeds:
        rows, weather = plain_adsb(rows, seed, config.deviation_mean_k, wind_error_mps)
    world = World(rows, flights, truth, name, seed, planting.causes, weather)
    if out is not None:
        world.write(out, truth_out)
    return world


def _chunk(
    aircraft: PerformanceModel,
    numbers: range,
    seed: int,
    config: WorldConfig,
    change: Callable[[FlightParameters], FlightParameters],
) -> tuple[pl.DataFrame, pl.DataFrame, pl.DataFrame]:
    """Rows, flights and truth of some flights of a world."""
    operators = config.operators or default_operators(aircraft)
    parameters = change(draw_parameters(aircraft, numbers, seed, config))
    prefixes = [operators[i].name for i in parameters.operator.tolist()]
    named = name_flights(
        aircraft.typecode, numbers, seed, config.flights_per_aircraft, prefixes, parameters.day.tolist()
    )
    truth = truth_table(named, fly(aircraft, parameters, config))
    tracks = parameters.weather.track_rad.tolist() if parameters.weather.tailwind_mps.numel() else None
    rows = observe(named, truth, seed, numbers, config, parameters.injected, tracks)
    return rows, flights_table(named, parameters, operators), truth
