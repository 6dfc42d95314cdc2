"""Flights of JSBSim's models with their truth, and the rows that a radar would have of them."""

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import polars as pl
import torch
from joblib import Parallel, delayed

from descentflow.core.errors import ConfigError, DataError
from descentflow.core.units import FL_M, FPM_MPS, KT_MPS
from descentflow.core.workers import results_of
from descentflow.physics.atmosphere import isa_temperature_k
from descentflow.simulation.autopilot import LABELS
from descentflow.simulation.injected import Injected, neutral
from descentflow.simulation.observe import observe
from descentflow.simulation.truth import Flight, name_flights
from studies.jsbsim_world.airframes import Airframe, airframe_of
from studies.jsbsim_world.flight_plans import OPERATORS, FlightPlan, JsbsimConfig, day_of, draw_plans
from studies.jsbsim_world.model_aircraft import FlightFailed
from studies.jsbsim_world.model_effects import inject
from studies.jsbsim_world.model_files import jsbsim
from studies.jsbsim_world.model_flight import COLUMNS, ModelFleet, Record
from studies.process_engine import alone

_INSTRUMENTS = ("cas_bias_mps", "cas_bias_slope_mps", "rate_lag_s", "noise_factor")


@dataclass(frozen=True)
class JsbsimWorld:
    """Rows, and the truth behind them.

    Example:
        >>> rows, flights, truth = (pl.read_parquet(f"rows{name}.parquet") for name in ("", "_flights", "_truth"))
        >>> failures = pl.DataFrame({"flight_id": ["MD11-0-00007"], "number": [7], "reason": ["banked"]})
        >>> print(JsbsimWorld(rows, flights, truth, failures))
        120 flights, ... rows, 1 failed: banked
    """

    rows: pl.DataFrame
    """Surveillance reports in the package's row schema."""
    flights: pl.DataFrame
    """One row per flight: everything drawn and injected."""
    truth: pl.DataFrame
    """One row per flight and time, see :func:`fly`."""
    failures: pl.DataFrame
    """Flights that are not in the other tables: ``flight_id``, ``number`` and ``reason``."""

    def __str__(self) -> str:
        """Number of flights, and of failures by reason."""
        reasons = Counter(self.failures["reason"].to_list())
        failed = "".join(f", {count} failed: {reason}" for reason, count in reasons.items())
        return f"{len(self.flights)} flights, {len(self.rows)} rows{failed}"


def fly(
    model: str,
    n_flights: int,
    seed: int,
    effects: Mapping[str, Mapping[str, float]] | None = None,
    *,
    config: JsbsimConfig | None = None,
    typecode: str | None = None,
    workers: int = 1,
    progress: Callable[[int], object] | None = None,
) -> JsbsimWorld:
    """Fly descents of a JSBSim model from level cruise to FL95, and report them as a radar would.

    Speed is held by elevator at idle thrust, Mach first and CAS below the crossover. A flight that cannot be trimmed,
    diverges, banks or does not hold its speed is left out of all tables and listed in ``failures``.

    Truth has ``flight_id``, ``timestamp``, ``time_s``, ``altitude_m`` (pressure), ``height_m`` (geometric),
    ``cas_mps``, ``mach``, ``tas_mps``, ``groundspeed_mps``, ``rate_mps`` (of pressure altitude), ``gamma`` (through the
    air, radians), ``drag_n``, ``thrust_n`` (along the path), ``mass_kg``, ``temperature_k``, ``deviation_k`` (from ISA
    at that pressure altitude), ``wind_mps`` (tailwind), ``brake`` (0 to 1), ``lever`` (0 to 1), ``speed_error_mps`` and
    ``label``.

    Args:
        model: One of :data:`studies.jsbsim_world.airframes.AIRFRAMES`.
        n_flights: Flights wanted, at least one; those that fail are not replaced.
        seed: Not negative; flight number k of a seed is the same in any world that has it.
        effects: Values by the name of an effect of
            :data:`studies.jsbsim_world.model_effects.EFFECTS`; nothing is injected if absent.
        config: Spreads, steps and the radar's noise.
        typecode: Type that the rows name; the model's own if absent.
        workers: Processes; without effect on the result.
        progress: Called with the number of flights just flown.

    Returns:
        Rows, flights, truth and failures.

    Raises:
        ConfigError: If JSBSim is not installed, or the model, the counts or an effect cannot be.
        DataError: If every flight fails.

    Example:
        >>> world = fly("MD11", n_flights=1, seed=0, effects={"mass": {"factor": 1.05}})
        >>> print(world)
        1 flights, ... rows
        >>> world.truth.columns[:3]
        ['flight_id', 'timestamp', 'time_s']
    """
    config = config or JsbsimConfig()
    airframe = airframe_of(model)
    if n_flights < 1 or seed < 0 or workers < 1:
        raise ConfigError(
            f"{n_flights} flights with seed {seed} in {workers} processes",
            expected="at least one flight, a seed of at least 0 and at least one process",
            mend="pass positive numbers",
        )
    jsbsim()
    plans = inject(
        airframe,
        draw_plans(airframe, range(n_flights), seed, config),
        effects or {},
        seed,
        config.flights_per_aircraft,
    )
    prefixes = [OPERATORS[p.operator] for p in plans]
    days = [day_of(number, config) for number in range(n_flights)]
    flown_type, each = typecode or airframe.typecode, config.flights_per_aircraft
    named = name_flights(flown_type, range(n_flights), seed, each, prefixes, days)
    outcomes = _flown(airframe, plans, config, workers, progress)
    reasons = [flown if isinstance(flown, str) else None for flown in outcomes]
    failures = pl.DataFrame(
        [(f.flight_id, p.number, why) for f, p, why in zip(named, plans, reasons, strict=True) if why],
        schema={"flight_id": pl.String, "number": pl.Int64, "reason": pl.String},
        orient="row",
    )
    kept = [(f, flown) for f, flown in zip(named, outcomes, strict=True) if not isinstance(flown, str)]
    if not kept:
        counts = Counter(failures["reason"].to_list())
        raise DataError(
            f"all {n_flights} flights of the {model} failed: {', '.join(f'{n} {why}' for why, n in counts.items())}",
            expected="flights that the model can fly",
            mend="inject smaller effects or choose other speeds and levels",
        )
    return _world([f for f, _ in kept], [flown for _, flown in kept], seed, config, failures)


def _flown(
    airframe: Airframe,
    plans: Sequence[FlightPlan],
    config: JsbsimConfig,
    workers: int,
    progress: Callable[[int], object] | None,
) -> list[Record | str]:
    """Each flight's record, or the reason of its failure."""
    if workers == 1:
        return _fly_share(airframe, plans, config, progress)
    shares = [plans[first : first + 10] for first in range(0, len(plans), 10)]
    outcomes: list[Record | str] = []
    parallel = Parallel(workers, backend="loky", batch_size=1, return_as="generator", initializer=alone)
    for done in results_of(parallel, (delayed(_fly_share)(airframe, share, config) for share in shares)):
        outcomes += done
        if progress is not None:
            progress(10)
    return outcomes


def _fly_share(
    airframe: Airframe,
    plans: Sequence[FlightPlan],
    config: JsbsimConfig,
    progress: Callable[[int], object] | None = None,
) -> list[Record | str]:
    outcomes: list[Record | str] = []
    with TemporaryDirectory(prefix="descentflow-jsbsim-") as folder:
        fleet = ModelFleet(airframe, Path(folder), config)
        for plan in plans:
            try:
                outcomes.append(fleet.fly(plan))
            except FlightFailed as failure:
                outcomes.append(str(failure))
            if progress is not None:
                progress(1)
    return outcomes


def _world(
    named: Sequence[Flight], records: Sequence[Record], seed: int, config: JsbsimConfig, failures: pl.DataFrame
) -> JsbsimWorld:
    truth = _truth_table(named, records)
    plans = [record.plan for record in records]
    rows = observe(named, truth, seed, [p.number for p in plans], config.radar, _instruments(plans))
    return JsbsimWorld(rows, _flights_table(named, plans), truth, failures)


def _instruments(plans: Sequence[FlightPlan]) -> Injected:
    columns = {name: torch.tensor([getattr(p, name) for p in plans], dtype=torch.float64) for name in _INSTRUMENTS}
    return replace(neutral(len(plans)), **columns)


def _truth_table(named: Sequence[Flight], records: Sequence[Record]) -> pl.DataFrame:
    lengths = [len(record.rows) for record in records]
    values = dict(zip(COLUMNS, np.concatenate([record.rows for record in records]).T, strict=True))
    isa = isa_temperature_k(torch.from_numpy(values["altitude_m"].copy())).numpy()
    codes = pl.Series(values.pop("label")).cast(pl.UInt32)
    values["deviation_k"] = values["temperature_k"] - isa
    start = np.repeat(np.array([f.start_us for f in named], dtype=np.int64), lengths)
    stamps = pl.Series(start + np.rint(values["time_s"] * 1e6).astype(np.int64)).cast(pl.Datetime("us", "UTC"))
    index = pl.Series(np.repeat(np.arange(len(named), dtype=np.uint32), lengths))
    names = pl.Series("flight_id", [f.flight_id for f in named]).gather(index)
    labels = pl.Series("label", list(LABELS), dtype=pl.Enum(LABELS)).gather(codes)
    return pl.DataFrame({"flight_id": names, "timestamp": stamps, **values, "label": labels})


def _flights_table(named: Sequence[Flight], plans: Sequence[FlightPlan]) -> pl.DataFrame:
    """One row per flight: names, and every number of its plan, in field units for levels and speeds."""
    about = {name: [getattr(f, name) for f in named] for name in ("flight_id", "icao24", "callsign", "typecode")}
    in_field_units = {"cas_mps": ("cas_kt", KT_MPS), "hold_rate_mps": ("hold_rate_fpm", FPM_MPS)}
    in_field_units |= {f"{k}_m": (f"{k}_fl", FL_M) for k in ("top", "bottom", *_WINDOWS)}
    columns: dict[str, object] = {"operator": [OPERATORS[p.operator] for p in plans]}
    for name in FlightPlan.__dataclass_fields__:
        if name not in ("operator", "wander", "layered_mps"):
            new, unit = in_field_units.get(name, (name, None))
            columns[new] = [getattr(p, name) if unit is None else getattr(p, name) / unit for p in plans]
    return pl.DataFrame({**about, **columns}).with_columns(pl.col(pl.Float64).fill_nan(None))


_WINDOWS = ("brake_high", "brake_low", "hold_high", "hold_low", "ice_high", "ice_low")
