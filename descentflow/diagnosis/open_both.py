"""Real flights and the simulator opened together: one cleaning for both, and where either comes from."""

import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import polars as pl

from descentflow.aircraft_types.registry import aircraft as find_aircraft
from descentflow.core.errors import ConfigError, DescentflowWarning
from descentflow.core.version import __version__
from descentflow.diagnosis.findings.inputs_found import CoefficientsUsed, InputUsed, Provenance
from descentflow.diagnosis.input_descriptions import input_of_flights
from descentflow.diagnosis.simulator import Simulator, of_its_type
from descentflow.diagnosis.simulator_flights import (
    SignatureSource,
    check_no_source,
    of_one_type,
    simulator_of_flights,
    types_of,
)
from descentflow.diagnosis.simulator_kind import kind_of, name_of
from descentflow.physics.performance_model import PerformanceModel
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
    air: str | Path | Sequence[str | Path] | None = None,
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
    if kind == "model":
        return _with_model(real, simulator, source, say, any_type=any_type, air=air, columns=columns)
    of_type = isinstance(simulator, PerformanceModel)
    found = Simulator(simulator if of_type else find_aircraft(str(simulator), source.bada_dir))
    say("reading flights")
    descents = open_descents(real, columns=columns, progress=say)
    frame, found, others = _of_type(descents, found, any_type=any_type)
    code = found.aircraft.typecode
    nominal = InputUsed(f"nominal {code}", "nominal BADA", 0, typecodes=[code])
    return Opened(
        frame, found, input_of_flights(name_of(real), descents), nominal, {**_rows_dropped(descents), **others}
    )


def _of_type(
    descents: Descents, simulator: Simulator, *, any_type: bool
) -> tuple[pl.DataFrame, Simulator, dict[str, int]]:
    """Real flights of the simulator's type, or any, and the counts of others."""
    if any_type:
        # Those that are compared, for the page to call them by.
        types, aircraft = types_of(descents.reported), simulator.aircraft
        used = CoefficientsUsed(aircraft.typecode, aircraft.source, types)
        return descents.reported, replace(simulator, coefficients=used), {}
    frame, others = of_its_type(descents.reported, simulator)
    if others:
        left_out = ", ".join(f"{number:,} of {name.rpartition('_')[2]}" for name, number in others.items())
        warnings.warn(
            f"flights of other types are left out: {left_out}; --any-type (any_type=True) takes them too",
            DescentflowWarning,
            stacklevel=4,
        )
    return frame, simulator, others


def _with_model(
    real: Any,
    model: Any,
    source: SignatureSource,
    say: Callable[[str], None],
    *,
    any_type: bool,
    air: str | Path | Sequence[str | Path] | None,
    columns: Mapping[str, str] | None,
) -> Opened:
    # Here and not above: a comparison of flights with flights must not pay for models.
    from descentflow.diagnosis.open_simulator import input_of_model, open_simulator, own_flights, without_weather
    from descentflow.representation.encode_flights import comparable_descents

    if source.bada_dir is not None:
        raise ConfigError(
            "BADA files for a simulator that has its own coefficients",
            expected="them with the designator of a type, or with a simulator's flights",
            mend="name the type, or leave the folder out",
        )
    found = open_simulator(model)
    parts = found.representation
    assert parts is not None
    say("reading flights")
    descents = comparable_descents(real, parts, columns=columns, progress=say)
    frame, found, others = _of_type(descents, found, any_type=any_type)
    if air is not None or parts.air is not None:
        frame, unknown = without_weather(frame, parts, air)
        others |= {"flights_of_unknown_air": unknown} if unknown else {}
        warnings.warn(
            f"{found.name} knows the air of its flights: both sides are compared in standard air, each flight brought "
            "there by its own temperature and wind, so that the weather is none of the causes"
            + (f"; {unknown:,} real flights of whose air nothing is known are left out" if unknown else ""),
            DescentflowWarning,
            stacklevel=4,
        )
    seen = {} if parts.seen is None else own_flights(frame, found.name, parts.seen)
    dropped = {**_rows_dropped(descents), **others, **seen}
    return Opened(frame, found, input_of_flights(name_of(real), descents), input_of_model(found), dropped)


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
