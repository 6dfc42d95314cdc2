"""Qualify a simulator: flights and means against limits, with causes, and the record that assurance asks for."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
import torch

from descentflow.core.arguments import Count, Output, Seed, checked_arguments
from descentflow.core.files import check_folder
from descentflow.core.threads import one_thread
from descentflow.diagnosis.correction.effects_in_flights import AddedEffects
from descentflow.diagnosis.diagnose import diagnose_prepared
from descentflow.diagnosis.diagnosis_steps import left_with
from descentflow.diagnosis.findings.costs_found import Measured
from descentflow.diagnosis.report.gap_report import GapReport
from descentflow.diagnosis.sides.diagnosis_inputs import Inputs, Opened
from descentflow.diagnosis.sides.diagnosis_settings import Settings
from descentflow.diagnosis.sides.measured_sides import both_sides
from descentflow.diagnosis.sides.simulator import Simulator
from descentflow.diagnosis.sides.two_sides import Compared, compare
from descentflow.effects import EFFECTS
from descentflow.measurements.quantity_registry import CHANNELS
from descentflow.qualification._assurance import budget_of, domain_of, factors_of, independence_of
from descentflow.qualification._predicted_times import flown_as_predicted, table_of_times
from descentflow.qualification.deviations import BAND_FL, Deviation, by_level, of_predictions, own_predictions
from descentflow.qualification.equivalence import MeanOfFlights, Verdict, judge, mean_of
from descentflow.qualification.limits import UNITS, Limit, Limits, read_limits
from descentflow.qualification.qualification_report import FILES, Qualification
from descentflow.qualification.record import Row
from descentflow.surveillance.descents.prepared_descents import Descents
from descentflow.surveillance.open_descents import FlightSource, paths_of

BY_RULE = MeanOfFlights(0.0, 0.0, 0, 0)
SAMPLES = 1000
"""Descents that are drawn of a model."""


@checked_arguments
def qualify(
    real: Any,
    simulator: Any = None,
    *,
    limits: str | Path = "part60",
    typecode: str | None = None,
    nearest_type: bool = False,
    bada_dir: str | Path | None = None,
    any_type: bool = False,
    columns: Mapping[str, str] | None = None,
    simulator_columns: Mapping[str, str] | None = None,
    simulator_name: str | None = None,
    samples: Count = SAMPLES,
    seed: Seed = 0,
    out: Output | None = None,
    progress: Callable[[str], None] | None = None,
) -> Qualification:
    """Say whether a simulator descends as real flights do, within limits, and make the record of it.

    Surveillance supports a distribution of descents. It replaces no flight test.

    Args:
        real: Real flights, as :func:`descentflow.diagnosis.diagnose.diagnose` takes them.
        simulator: A checkpoint, of which descents are drawn; flights of any simulator; a type, for nominal BADA; or a
            predictor's table of times for the real flights, see
            ``table_of_times``.
        limits: ``part60`` (14 CFR Part 60, Table A2A, test 1.d.4), ``look_ahead`` (errors of predictions, which are
            measured), or a YAML file, see :func:`~descentflow.qualification.limits.read_limits`.
        typecode: In place of ``simulator``, its nominal descent; or the type whose coefficients carry the rate from one
            airspeed to another.
        nearest_type: Whether the nearest type may stand for one without coefficients.
        bada_dir: Folder of BADA files; the embedded open aircraft if absent.
        any_type: Whether real flights of other types are taken.
        columns: Name in a row -> column of the real rows' tables.
        simulator_columns: The same of a simulator's rows.
        simulator_name: Name of the simulator on the page.
        samples: Number of descents drawn of a model.
        seed: Of draws and permutations.
        out: Folder for `qualification.json` and `qualification.html`.
        progress: Called with what is being done.

    Returns:
        The record; printed, it is the answer in a few lines.

    Raises:
        AircraftError: If the type is not known.
        CheckpointError: If a checkpoint cannot be read.
        ConfigError: If neither a simulator nor a type is named, or the limits cannot be read.
        DataError: If flights cannot be used, or are fewer than five a side.

    Example:
        >>> print(qualify("descents.parquet", "A320"))
        Nominal BADA of the A320 is inside the limits of part60, by 120 real A320 flights.
        ...
        >>> qualify("descents.parquet", "best.ckpt").rows[0].quantity
        'airspeed'
    """
    say = progress or (lambda _: None)
    asked = read_limits(limits)
    if out is not None:
        check_folder(out, *FILES)
    times, name, unused = table_of_times(simulator), simulator_name, dict[str, int]()
    if times is not None:
        real, columns = FlightSource(real, columns, say).descents(), None
        name = name or next((f"the predictor of {path.name}" for path in paths_of(simulator)), None)
        simulator, unused = flown_as_predicted(real, times)
    opened = Inputs(
        real, simulator, typecode, bada_dir, nearest_type, any_type, None, columns, simulator_columns, say
    ).open()
    opened = replace(opened, dropped={**opened.dropped, **unused})
    made = replace(opened.simulator, name=name or opened.simulator.name)
    with one_thread():
        settings = Settings(made, EFFECTS, CHANNELS, seed, say)
        findings = diagnose_prepared(opened.frame, settings, opened.dropped)
        provenance = opened.provenance({"seed": str(seed), "limits": asked.name}, [])
        gap = GapReport(**vars(replace(findings, provenance=provenance)))
        say("judging by the limits")
        qualification = _qualified(opened, made, asked, gap, samples, by_flight=times is not None)
        if out is not None:
            say("writing the record")
            qualification.write(out)
    return qualification


@torch.inference_mode()
def _qualified(
    opened: Opened, simulator: Simulator, asked: Limits, gap: GapReport, samples: int, *, by_flight: bool
) -> Qualification:
    """The record of opened flights and their diagnosis; ``by_flight`` if each was predicted, and has its own."""
    seed = gap.details.seed
    flown = simulator if simulator.model is None else _drawn(simulator, samples, seed)
    sides = both_sides(flown, opened.frame, CHANNELS, BAND_FL)
    compared = compare(sides.simulated, sides.real, simulator.aircraft)
    theta = {
        cause.effect: torch.tensor([size.estimate for size in cause.parameters.values()], dtype=torch.float64)
        for cause in gap.causes
        if not cause.inherited
    }
    added = AddedEffects(EFFECTS, theta, compared.state.mass_kg, simulator.cleaning, seed)
    own = own_predictions(sides) if by_flight else None
    rows = judged_rows(compared, asked, added if theta else None, own)
    return Qualification(
        _together([row.verdict for row in rows]),
        asked.name,
        asked.source,
        rows,
        domain_of(opened.frame, compared),
        independence_of(gap),
        budget_of(rows, gap),
        factors_of(gap, asked.source),
        gap,
    )


def _drawn(simulator: Simulator, samples: int, seed: int) -> Simulator:
    """The descents that a model draws, as flights of a simulator: each of an aircraft and a day of its own."""
    # Here and not above: flights of other simulators need no model.
    from descentflow.generation.sample import sample

    assert simulator.model is not None
    air = "standard" if simulator.model.representation.air is not None else None
    table = sample(simulator.model, samples, seed=seed, air=air).to_polars()
    began = pl.datetime(2000, 1, 1, time_zone="UTC")
    flights = table.select(
        "level_fl",
        "time_s",
        "Mach",
        "TAS",
        "vertical_rate",
        IAS="CAS",
        flight_id=pl.format("sample {}", "sample_id"),
        icao24=pl.format("{}", "sample_id"),
        typecode=pl.lit(simulator.aircraft.typecode),
        timestamp=began + pl.duration(days="sample_id") + pl.duration(milliseconds=1000 * pl.col("time_s")),
    )
    return replace(simulator, flights=Descents(flights, {}), model=None)


def judged_rows(
    compared: Compared, asked: Limits, added: AddedEffects | None, own: torch.Tensor | None = None
) -> list[Row]:
    """Judgements of all that has a limit, or is asked for."""

    def all_of(y: torch.Tensor) -> list[Deviation]:
        predicted = any(limit.quantity not in ("airspeed", "rate") for limit in asked.limits)
        ahead = of_predictions(compared, y, asked.minutes, own) if predicted else []
        return [*by_level(compared, y, own), *ahead]

    after = {_key(deviation): deviation for deviation in all_of(left_with(compared, added))} if added else {}
    keyed = {_key(deviation): deviation for deviation in all_of(compared.y)}
    limited = [(keyed[key], limit, after.get(key)) for key in keyed if (limit := asked.limit_on(*key))]
    judged = sum(limit.width(deviation.simulator) is not None for deviation, limit, _ in limited)
    return [_row(compared, *judgement, max(judged, 1)) for judgement in limited]


def _key(deviation: Deviation) -> tuple[str, tuple[float, float], float | None]:
    return deviation.quantity, deviation.levels, deviation.minutes


def _row(compared: Compared, deviation: Deviation, limit: Limit, again: Deviation | None, tests: int) -> Row:
    real, width = compared.real.numpy(), limit.width(deviation.simulator)
    means = _means(compared, deviation.of_flights)
    judged, inside = judge(*means, width, tests), None
    count = means[0].flights if np.isfinite(judged.difference.estimate) else 0
    if width is not None and count:
        within = np.where(np.isfinite(deviation.of_flights), np.abs(deviation.of_flights) <= width, np.nan)
        spread = judge(_means(compared, within)[0], BY_RULE, None).difference
        ends = [None if x is None else min(max(x, 0.0), 1.0) for x in (spread.low, spread.high)]
        inside = Measured(spread.estimate, *ends)
    corrected = None if again is None else judge(*_means(compared, again.of_flights), None).difference
    by_air = None
    if deviation.by_air is not None and np.isfinite(deviation.by_air[real]).any():
        by_air = float(np.nanmean(deviation.by_air[real]))
    return Row(
        deviation.quantity,
        UNITS[deviation.quantity][1],
        *deviation.levels,
        deviation.minutes,
        width,
        count,
        judged.difference if count else None,
        inside,
        judged.verdict,
        judged.more_flights,
        judged.decides,
        by_air,
        corrected if corrected is not None and np.isfinite(corrected.estimate) else None,
        limit.source,
    )


def _means(compared: Compared, deviations: np.ndarray[Any, Any]) -> tuple[MeanOfFlights, MeanOfFlights]:
    """Means of the real flights and of the simulator's; a rule without flights has none of its own."""
    real, groups = compared.real.numpy(), (compared.airframe.numpy(), compared.day.numpy())
    sides = [mean_of(deviations[side], *(ids[side] for ids in groups)) for side in (real, ~real)]
    return sides[0], sides[1] if compared.has_simulated else BY_RULE


def _together(verdicts: Sequence[Verdict]) -> Verdict:
    """Verdict on all rows (Berger 1982: all must pass, at the level of one)."""
    judged = [verdict for verdict in verdicts if verdict != "not judged"]
    for verdict in ("outside", "not enough flights"):
        if verdict in judged:
            return verdict
    return "inside" if judged else "not judged"
