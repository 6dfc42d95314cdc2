"""Coefficients of a type that agree with real flights: :func:`repair`."""

from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl

from descentflow.aircraft_types.registry import aircraft as find_aircraft
from descentflow.aircraft_types.registry import file_of
from descentflow.core.arguments import Output, checked_arguments
from descentflow.core.errors import AircraftError, DataError
from descentflow.core.linear_gaussian import Array
from descentflow.repairs._crew_speeds import CrewSpeed, crew_speeds
from descentflow.repairs.held_out import held_out
from descentflow.repairs.mixed_model import Z_90, MixedModelPosterior
from descentflow.repairs.repair_found import FACTORS, SPEEDS, CoefficientEstimate, Repair
from descentflow.repairs.repaired_files import check_out, write_repair
from descentflow.repairs.type_fit import Repairable, TypeFlights, fit_types, type_flights
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
        aircraft: Type designator; of BADA 4 also the name of a model.
        bada_dir: Folder of BADA 3 or BADA 4; None for the open aircraft.
        out: File of coefficients to write, ``A320.toml``, with the OPF, APF and other files next to it, and a page. Of
            BADA 4 the page, ``A320.html``, with the model's own XML file next to it.
        columns: Name in a row -> column of the rows' tables.
        progress: Called with what is being done.

    Raises:
        AircraftError: If the type is not known, or has pistons.
        DataError: If flights cannot be read, lack airspeeds, or are too few.
        ConfigError: If the output cannot be written.

    Example:
        >>> repaired = repair("descents.parquet", aircraft="A320")
        >>> print(repaired)
        A320: 120 flights of 24 aircraft
          cd0_cr ...
    """
    say = progress or (lambda _: None)
    before = _known(aircraft, bada_dir)
    own_file = None if bada_dir is None else file_of(aircraft, bada_dir)
    if out is not None:
        check_out(Path(out), before.typecode, own_file)
    say("reading flights")
    frame = FlightSource(flights, columns, say).descents().reported
    types, skipped = _types(frame, before, bada_dir, say)
    say("estimating")
    posterior = fit_types(types)
    say("predicting aircraft that were not used")
    judged = held_out(types, _finished)
    after = before
    if judged.better:
        by = f"repaired by {judged.flights} flights of {judged.aircraft} aircraft; {before.source}"
        after = replace(_finished(types[0], posterior.of(0)[0]), source=by)  # type: ignore[type-var]
    own = types[0]
    counts: dict[str, float] = {"flights_without_air": own.evidence.without_air, "powered_bands": own.evidence.powered}
    counts |= {f"share_with_{name}": share for name, share in own.unusual.items()}
    counts |= {f"flights_of_{name}": number for name, number in skipped.items()}
    result = Repair(
        before,
        after,
        tuple(_estimates(before, own, posterior)),
        judged,
        posterior,
        {flights.aircraft.typecode: len(flights.evidence) for flights in types},
        counts,
        own.evidence.quantities.levels_fl,
        f"{frame['timestamp'].to_numpy().max().astype('datetime64[s]').item():%b %d %Y}",
        own_file,
    )
    if out is not None:
        say("writing")
        write_repair(result, Path(out))
    return result


def _known(typecode: str, bada_dir: str | Path | None) -> Repairable:
    aircraft = find_aircraft(typecode, bada_dir)
    aircraft.repaired_numbers()  # a type without refuses
    return aircraft


def _types(
    frame: pl.DataFrame, before: Repairable, bada_dir: str | Path | None, say: Callable[[str], None]
) -> tuple[list[TypeFlights], dict[str, int]]:
    """Flights of the type, then of its sisters (types with coefficients and the same kind of engines); and the rest."""
    counts = dict(frame.group_by("typecode").agg(pl.col("flight_id").n_unique()).iter_rows())
    types, skipped = [], {}
    for code in (before.typecode, *sorted(set(counts) - {before.typecode, None})):
        some = frame.filter(typecode=code)
        try:
            kind = before if code == before.typecode else _known(code, bada_dir)
            if kind.engine != before.engine:
                raise AircraftError(code, expected=f"a {before.engine}", mend="leave it out")
            say(f"measuring {code}")
            if some.is_empty():
                raise DataError(
                    f"no flight of {code} among {', '.join(map(str, sorted(counts)))}",
                    expected="flights of the type that is to be repaired",
                    mend="give --aircraft another type, or other flights",
                )
            types.append(type_flights(some, kind, frame))
        except (AircraftError, DataError):
            if code == before.typecode:
                raise
            skipped[code] = counts[code]
    flights, aircraft = sum(len(flights.evidence) for flights in types), len(np.unique(types[0].tails))
    if flights < FEWEST_FLIGHTS or aircraft < FEWEST_AIRCRAFT:
        raise DataError(
            f"{flights} flights with whole bands of free descent, {aircraft} aircraft of {before.typecode}",
            expected=f"at least {FEWEST_FLIGHTS} flights, sisters included, and {FEWEST_AIRCRAFT} aircraft of the type",
            mend=f"give flights of more {before.typecode}"
            if aircraft < FEWEST_AIRCRAFT
            else "give more flights, or those of sister types next to them",
        )
    return types, skipped


def _speeds(own: TypeFlights) -> dict[str, CrewSpeed]:
    return crew_speeds(own.evidence, {name: float(getattr(own.aircraft, name)) for name in SPEEDS})


def _finished(own: TypeFlights, theta: Array) -> Repairable:
    """The file at coefficients (3,), with the crews' speeds, in the digits that are written."""
    factors = dict(zip(FACTORS, (np.exp(theta[0]), np.exp(theta[1]), 1 + theta[2]), strict=True))
    numbers = own.aircraft.repaired_numbers().items()
    speeds = {name: round(held.estimate, SPEEDS[name]) for name, held in _speeds(own).items()}
    made = {name: _rounded(value * factors[factor]) for name, (factor, value) in numbers}
    return own.aircraft.with_numbers(**made, **speeds)


def _rounded(value: float) -> float:
    return float(f"{float(value):.{DIGITS}g}")


def _estimates(before: Repairable, own: TypeFlights, posterior: MixedModelPosterior) -> list[CoefficientEstimate]:
    mean, covariance = posterior.of(0)
    spread = Z_90 * np.sqrt(covariance.diagonal())
    made = []
    for name, (factor, value) in before.repaired_numbers().items():
        k = FACTORS.index(factor)
        ends = mean[k] + np.array([0.0, -spread[k], spread[k]])
        middle, *both = (value * float(by) for by in (np.exp(ends) if k < 2 else 1 + ends))
        made.append(CoefficientEstimate(name, value, _rounded(middle), min(both), max(both), "flights"))
    for name, speed in _speeds(own).items():
        estimate = round(speed.estimate, SPEEDS[name])
        made.append(
            CoefficientEstimate(
                name, float(getattr(before, name)), estimate, speed.low, speed.high, "speeds held", speed.aircraft
            )
        )
    return made
