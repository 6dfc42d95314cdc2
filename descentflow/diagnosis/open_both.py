"""Real flights and the simulator opened together: one cleaning for both, and where either comes from."""

import warnings
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import polars as pl

from descentflow.core.errors import ConfigError, DescentflowWarning
from descentflow.core.version import __version__
from descentflow.diagnosis.findings.inputs_found import CoefficientsUsed, InputUsed, Provenance
from descentflow.diagnosis.input_descriptions import input_of_flights, input_of_simulator
from descentflow.diagnosis.open_simulator import open_simulator
from descentflow.diagnosis.own_flights import own_flights
from descentflow.diagnosis.simulator import Simulator, of_its_type
from descentflow.diagnosis.simulator_flights import (
    SignatureSource,
    check_no_source,
    of_one_type,
    simulator_of_flights,
    types_of,
)
from descentflow.diagnosis.simulator_kind import kind_of, name_of
from descentflow.diagnosis.weather_taken_out import without_weather
from descentflow.representation.comparable_descents import comparable_descents
from descentflow.representation.own_air import AirSource
from descentflow.surveillance.descents.prepared_descents import Descents
from descentflow.surveillance.open_descents import open_descents, open_pair


@dataclass(frozen=True)
class Opened:
    """Opened inputs of a comparison.

    Attributes:
        frame: Prepared real descents.
        simulator: What is diagnosed.
        real_input: Where the former come from.
        simulator_input: Where the simulator comes from.
        dropped: Flights and rows that were left out, by reason.

    Example:
        >>> open_both("rows.parquet", "best.ckpt", SignatureSource()).simulator.name
        'best.ckpt'
    """

    frame: pl.DataFrame
    simulator: Simulator
    real_input: InputUsed
    simulator_input: InputUsed
    dropped: dict[str, int]

    def provenance(self, settings: dict[str, str]) -> Provenance:
        """Inputs by which the answer can be made again, with the settings of the diagnosis."""
        return Provenance(
            self.real_input,
            self.simulator_input,
            {"descentflow": __version__},
            settings,
            coefficients=self.simulator.coefficients,
        )


def open_both(
    real: Any,
    simulator: Any,
    source: SignatureSource,
    progress: Callable[[str], None] | None = None,
    *,
    any_type: bool = False,
    air: AirSource | None = None,
    columns: Mapping[str, str] | None = None,
    simulator_columns: Mapping[str, str] | None = None,
) -> Opened:
    """Open real flights and the simulator that they are compared with.

    Args:
        real: As :func:`~descentflow.diagnosis.diagnose.diagnose` takes it.
        simulator: The same; None for the nominal descent of the source's type.
        source: Whose coefficients give the signatures.
        progress: Called with what is being done.
        any_type: Whether real flights of other types than a checkpoint's or a nominal descent's are taken too; if not,
            they are left out and counted.
        air: Where the real flights' air is known from, for a model that knows the air of its own.
        columns: Name in a row -> column of the real rows' tables.
        simulator_columns: The same of the simulator's rows.

    Raises:
        AircraftError: If a type has no coefficients.
        CheckpointError: If a checkpoint cannot be read.
        ConfigError: If the simulator and the source contradict each other, or a checkpoint is corrected already.
        DataError: If flights cannot be read, or both sides are of different types.

    Warns:
        DescentflowWarning: If flights of other types are left out, a checkpoint knows the air of its flights, which is
            then taken out of both sides, or most of the real flights are its own.

    Example:
        >>> opened = open_both("rows.parquet", "descents.parquet", SignatureSource())
        >>> [(side.name, side.flights) for side in (opened.real_input, opened.simulator_input)]
        [('rows.parquet', 120), ('descents.parquet', 120)]
    """
    say = progress or (lambda _: None)
    if simulator is None:
        simulator, source = source.typecode, SignatureSource(bada_dir=source.bada_dir, nearest=source.nearest)
    kind = kind_of(simulator)
    if air is not None and kind != "model":
        raise ConfigError(
            "an air of the flights, for a simulator that is no model of drag in its flights' own air",
            expected="a checkpoint that was fitted with data.air=measured or a weather field",
            mend="leave the air out",
        )
    if kind == "flights":
        say("reading flights")
        pair = open_pair(real, simulator, columns=columns, simulator_columns=simulator_columns, progress=say)
        return _with_flights(real, simulator, source, pair)
    if simulator_columns:
        raise ConfigError(
            "columns of a simulator that is not given as flights",
            expected="them for rows of its flights",
            mend="leave them out; columns of the real rows are `columns` (--column)",
        )
    check_no_source(source, "a checkpoint" if kind == "model" else "a type")
    found = open_simulator(simulator, source.bada_dir)
    say("reading flights")
    parts = found.representation
    if parts is not None and parts.correction is not None:
        raise ConfigError(
            f"{found.name}, a simulator that is corrected already: the flights that it carries are those before",
            expected="the checkpoint that `descentflow fit` wrote, or flights",
            mend="diagnose what it flies: corrected.parquet beside it, or samples (descentflow sample) as --simulator",
        )
    if parts is None:
        descents = open_descents(real, columns=columns, progress=say)
    else:
        descents = comparable_descents(real, parts, columns=columns, progress=say)
    own = input_of_flights(name_of(real), descents)
    frame, others = (descents.reported, {}) if any_type else of_its_type(descents.reported, found)
    if any_type:
        # Those that are compared, for the page to call them by.
        types, aircraft = types_of(frame), found.aircraft
        found = replace(found, coefficients=CoefficientsUsed(aircraft.typecode, aircraft.source, types))
    if others:
        left_out = ", ".join(f"{number:,} of {name.rpartition('_')[2]}" for name, number in others.items())
        warnings.warn(
            f"flights of other types are left out: {left_out}; --any-type (any_type=True) takes them too",
            DescentflowWarning,
            stacklevel=3,
        )
    if parts is not None and (air is not None or parts.air is not None):
        frame, unknown = without_weather(frame, parts, air)
        others |= {"flights_of_unknown_air": unknown} if unknown else {}
        warnings.warn(
            f"{found.name} knows the air of its flights: both sides are compared in standard air, each flight brought "
            "there by its own temperature and wind, so that the weather is none of the causes"
            + (f"; {unknown:,} real flights of whose air nothing is known are left out" if unknown else ""),
            DescentflowWarning,
            stacklevel=3,
        )
    seen = {} if parts is None or parts.seen is None else own_flights(frame, found.name, parts.seen)
    return Opened(frame, found, own, input_of_simulator(found), {**_rows_dropped(descents), **others, **seen})


def _with_flights(real: Any, simulator: Any, source: SignatureSource, pair: tuple[Descents, Descents]) -> Opened:
    first, second = pair
    sides = of_one_type(first.reported, second.reported)
    name = name_of(simulator)
    found = simulator_of_flights(sides.simulator, sides.typecodes, source, name)
    found = replace(found, cleaning=second.cleaning, metadata=second.metadata)
    inputs = input_of_flights(name_of(real), first), input_of_flights(name, second)
    dropped = {**_rows_dropped(first), **_rows_dropped(second, "simulator_rows"), **sides.dropped}
    return Opened(sides.real, found, *inputs, dropped)


def _rows_dropped(descents: Descents, what: str = "rows") -> dict[str, int]:
    report = descents.metadata.get("report") or {}
    steps = report.get("steps", []) if isinstance(report, dict) else []
    return {f"{what}_{s['step']}": int(s["rows_dropped"]) for s in steps if s.get("rows_dropped")}
