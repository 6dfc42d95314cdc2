"""Coefficients of a type that agree with real flights: :func:`repair`."""

from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl

from descentflow.aircraft_types.bada3.bada3_aircraft import Bada3Aircraft
from descentflow.aircraft_types.registry import aircraft as find_aircraft
from descentflow.core.arguments import Output, checked_arguments
from descentflow.core.errors import AircraftError, DataError
from descentflow.diagnosis.inference.linear_gaussian import Array
from descentflow.physics.performance_model import PerformanceModel
from descentflow.repairs.crew_speeds import CrewSpeed, crew_speeds
from descentflow.repairs.held_out import held_out
from descentflow.repairs.mixed_model import WIDE, Posterior
from descentflow.repairs.repair_found import COEFFICIENTS, SPEEDS, Estimate, Repair
from descentflow.repairs.repaired_files import check_out, write_repair
from descentflow.repairs.type_fit import TypeFlights, fit_types, repaired, type_flights
from descentflow.surveillance.open_descents import FlightSource

FEWEST_FLIGHTS, FEWEST_AIRCRAFT = 20, 5
"""Of the type and its sisters together, and aircraft of the type itself."""
DIGITS = 4
"""Digits that an OPF file holds of any number, so that all files that are written have the same."""


@checked_arguments
def repair(
    flights: Any,
    *,
    aircraft: str,
    bada_dir: str | Path | None = None,
    out: Output | None = None,
    columns: Mapping[str, str] | None = None,
    progress: Callable[[str], None] | None = None,
) -> Repair:
    """Estimate the coefficients of a type that agree with real flights, at its reference mass.

    Flights tell drag minus idle thrust over mass by speed and density: CD0, CD2 and idle thrust about the reference
    mass, and the speeds that crews hold. What they do not tell keeps the file's value. Flights of sister types with
    coefficients, where there are any, share a prior.

    Args:
        flights: Rows or prepared descents, as :func:`~descentflow.diagnosis.diagnose.diagnose` takes real flights.
        aircraft: Type designator.
        bada_dir: BADA 3 files; None for the open aircraft.
        out: File of coefficients to write, ``A320.toml``, with the OPF, APF and other files beside it, and a page.
        columns: Name in a row -> column of the rows' tables.
        progress: Called with what is being done.

    Raises:
        AircraftError: If the type is not known, or is no BADA 3 type.
        DataError: If flights cannot be read, lack airspeeds, or are too few.
        ConfigError: If the output cannot be written.

    Example:
        >>> found = repair("descents.parquet", aircraft="A320")
        >>> print(found)
        A320: 120 flights of 24 aircraft
          cd0_cr ...
    """
    say = progress or (lambda _: None)
    before = _known(aircraft, bada_dir)
    if out is not None:
        check_out(Path(out), before.typecode, bada_dir)
    say("reading flights")
    frame = FlightSource(flights, columns, say).descents().reported
    types, skipped = _types(frame, before, bada_dir, say)
    say("estimating")
    found = fit_types(types)
    say("predicting aircraft that were not used")
    judged = held_out(types, _finished)
    after = _finished(types[0], found.of(0)[0]) if judged.better else before
    assert isinstance(after, Bada3Aircraft)
    own = types[0]
    counts: dict[str, float] = {"flights_without_air": own.evidence.without_air, "powered_bands": own.evidence.powered}
    counts |= {f"share_with_{name}": share for name, share in own.unusual.items()}
    counts |= {f"flights_of_{name}": number for name, number in skipped.items()}
    result = Repair(
        before,
        replace(after, source=f"repaired by {judged.flights} flights of {judged.aircraft} aircraft; {before.source}"),
        tuple(_estimates(before, own, found)),
        judged,
        found,
        tuple(one.aircraft.typecode for one in types),
        {one.aircraft.typecode: len(one.evidence) for one in types},
        counts,
        own.evidence.quantities.levels_fl,
        f"{frame['timestamp'].to_numpy().max().astype('datetime64[s]').item():%b %d %Y}",
        None if bada_dir is None else Path(bada_dir),
    )
    if out is not None:
        say("writing")
        write_repair(result, Path(out))
    return result


def _known(typecode: str, bada_dir: str | Path | None) -> Bada3Aircraft:
    found = find_aircraft(typecode, bada_dir)
    if not isinstance(found, Bada3Aircraft):
        raise AircraftError(
            f"{typecode} in another form than BADA 3",
            expected="coefficients of BADA 3, or the open ones",
            mend="repair the type's BADA 3 file",
        )
    return found


def _types(
    frame: pl.DataFrame, before: Bada3Aircraft, bada_dir: str | Path | None, say: Callable[[str], None]
) -> tuple[list[TypeFlights], dict[str, int]]:
    """Flights of the type, then of its sisters (types with coefficients and the same kind of engines); and the rest."""
    counts = dict(frame.group_by("typecode").agg(pl.col("flight_id").n_unique()).iter_rows())
    found, skipped = [], {}
    for code in (before.typecode, *sorted(set(counts) - {before.typecode, None})):
        some = frame.filter(typecode=code)
        try:
            kind: PerformanceModel = before if code == before.typecode else _known(code, bada_dir)
            if getattr(kind, "engine", None) != before.engine:
                raise AircraftError(code, expected=f"a {before.engine}", mend="leave it out")
            say(f"measuring {code}")
            if some.is_empty():
                raise DataError(
                    f"no flight of {code} among {', '.join(map(str, sorted(counts)))}",
                    expected="flights of the type that is to be repaired",
                    mend="give --aircraft another type, or other flights",
                )
            found.append(type_flights(some, kind, frame))
        except (AircraftError, DataError):
            if code == before.typecode:
                raise
            skipped[code] = counts[code]
    flights, aircraft = sum(len(one.evidence) for one in found), len(np.unique(found[0].tails))
    if flights < FEWEST_FLIGHTS or aircraft < FEWEST_AIRCRAFT:
        raise DataError(
            f"{flights} flights with whole bands of free descent, {aircraft} aircraft of {before.typecode}",
            expected=f"at least {FEWEST_FLIGHTS} flights, sisters included, and {FEWEST_AIRCRAFT} aircraft of the type",
            mend="give more flights, or those of sister types beside them",
        )
    return found, skipped


def _speeds(own: TypeFlights) -> dict[str, CrewSpeed]:
    return crew_speeds(own.evidence, {name: float(getattr(own.aircraft, name)) for name in SPEEDS})


def _finished(own: TypeFlights, theta: Array) -> PerformanceModel:
    """The file at coefficients (3,), with the crews' speeds, in the digits that are written."""
    found = repaired(own.aircraft, theta)
    assert isinstance(found, Bada3Aircraft)
    numbers: dict[str, Any] = {name: _rounded(getattr(found, name)) for name in COEFFICIENTS}
    numbers |= {name: round(held.estimate, SPEEDS[name]) for name, held in _speeds(own).items()}
    return replace(found, **numbers)


def _rounded(value: Any) -> float:
    return float(f"{float(value):.{DIGITS}g}")


def _estimates(before: Bada3Aircraft, own: TypeFlights, found: Posterior) -> list[Estimate]:
    mean, covariance = found.of(0)
    spread = WIDE * np.sqrt(covariance.diagonal())
    after = repaired(before, mean)
    made = []
    for name, k in COEFFICIENTS.items():
        value = float(getattr(before, name))
        ends = mean[k] - spread[k], mean[k] + spread[k]
        low, high = sorted(value * (np.exp(end) if k < 2 else 1 + end) for end in ends)
        made.append(Estimate(name, value, _rounded(getattr(after, name)), float(low), float(high), "flights"))
    for name, speed in _speeds(own).items():
        estimate = round(speed.estimate, SPEEDS[name])
        made.append(
            Estimate(name, float(getattr(before, name)), estimate, speed.low, speed.high, "speeds held", speed.aircraft)
        )
    return made
