"""Sample a model and score it against held-out flights: what `descentflow evaluate`, `test` and the callback call."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import polars as pl
from torch import Tensor

from descentflow.core.arguments import Count, checked_arguments
from descentflow.core.errors import DataError
from descentflow.core.threads import one_thread_where_they_spin
from descentflow.densities.checkpoint import as_density
from descentflow.densities.density import Density
from descentflow.densities.mixture_parameters import NO_CONTEXT
from descentflow.evaluation.evaluation_report import Evaluation, sampled_level_flight
from descentflow.evaluation.metrics.descent_set import DescentSet
from descentflow.evaluation.metrics.scores import score
from descentflow.generation.rejection import sample_descents
from descentflow.physics.nominal_descent import nominal_descent
from descentflow.representation.encode_flights import encode_flights, tell_other_types
from descentflow.representation.own_air import AirSource
from descentflow.representation.profiles import Profiles
from descentflow.representation.representation import Representation
from descentflow.surveillance.cleaning.level_flight import FLIGHTS, side_by_side
from descentflow.surveillance.open_descents import FlightSource

N_SPLITS = 100
"""Random splits behind each noise floor."""


@checked_arguments
@one_thread_where_they_spin()
def evaluate(
    model: object,
    real: object,
    *,
    simulator: object = None,
    n: Count = 10_000,
    seed: int = 0,
    context_table: str | Path | pl.DataFrame | None = None,
    air: AirSource | None = None,
    n_splits: Count = N_SPLITS,
    draw_budget: Count | None = None,
    progress: Callable[[int], None] | None = None,
    score_progress: Callable[[int], None] | None = None,
) -> Evaluation:
    """Sample a model and score the samples against flights that it has not seen (paper, section 4).

    Args:
        model: A checkpoint's path, a density, or a fitted model.
        real: Path of rows or of prepared descents, or descents in memory. Flights that the model was trained or
            validated on are left out and counted; they are recognised by aircraft and time under other names, too.
        simulator: Rows or prepared descents of a simulator, whose level flight is compared with the others'.
        n: Number of samples.
        seed: Of sampling, and of the splits behind the noise floors.
        context_table: Table, or path of one, with ``flight_id`` and the context, for a conditional model, or the
            masses, for a model of drag at each flight's own.
        air: Where the flights' air is known from, for a model of drag in its flights' own air: ``measured``, or a
            weather field; the former if absent, which a model fitted by a field refuses.
        n_splits: Random splits behind each noise floor.
        draw_budget: Most draws; 100 for each sample (at least 10,000) if absent.
        progress: Progress callback: called with the number of newly accepted samples.
        score_progress: Progress callback: called with 1 after each comparison, see
            :func:`~descentflow.evaluation.metrics.scores.n_comparisons`.

    Returns:
        The evaluation: it prints, converts, draws and writes itself.

    Raises:
        CheckpointError: If the checkpoint cannot be used.
        ConfigError: If no sample is asked for, or the context or the air does not fit the model.
        DataError: If the descents cannot be read, or the model has seen all of them.
        SamplingError: If too few draws are plausible.

    Example:
        >>> evaluation = evaluate("best.ckpt", "descents.parquet", n=500)
        >>> print(evaluation)
        24 held-out flights (96 left out: the checkpoint was trained or validated on them)
        In words: too few held-out flights to judge time to bottom, ...
        500 samples from ... draws (...)
        quantity ...
    """
    sampled = as_density(model)
    density = sampled.held_out_fit
    representation = density.representation
    notes: list[str] = []
    if density is not sampled:
        notes.append(f"scored: the fit to {density.representation.split.describe()}")
    if made := representation.provenance.get("airspeeds"):
        notes.append(f"the model: {made}")
    lowest_fl = float(representation.decoder.levels_fl[0])
    flights = FlightSource(real).for_model(representation.cleaning, lowest_fl)
    frame = flights.frame
    tell_other_types(frame, representation)
    parts = encode_flights(frame, representation, context_table, air=air, say=notes.append)
    evaluation = evaluate_profiles(
        density,
        representation,
        parts["test"].profiles,
        context=parts["test"].context,
        n=n,
        seed=seed,
        name=type(density).__name__,
        n_splits=n_splits,
        draw_budget=draw_budget,
        progress=progress,
        score_progress=score_progress,
    )
    sides = {"flights": flights.report.notes, "samples": sampled_level_flight(evaluation.samples)}
    if simulator is not None:
        sides["simulator"] = FlightSource(simulator).for_model(representation.cleaning, lowest_fl).report.notes
    level = side_by_side(sides if sides["flights"].get(FLIGHTS) else {})
    n_seen = len(parts["train"]) + len(parts["validation"])
    return replace(evaluation, n_seen=n_seen, notes=tuple(notes), level_flight=level)


def evaluate_profiles(
    model: Density,
    representation: Representation,
    real: Profiles,
    *,
    context: Tensor = NO_CONTEXT,
    n: int = 10_000,
    seed: int = 0,
    name: str = "samples",
    n_splits: int = N_SPLITS,
    costly: bool = True,
    draw_budget: int | None = None,
    progress: Callable[[int], None] | None = None,
    score_progress: Callable[[int], None] | None = None,
) -> Evaluation:
    """:func:`evaluate` for flights that are on the model's grid already, all of which count as held out.

    Entry levels are drawn from those of the flights (paper, section 4.2); with a context, each sample has the entry
    level and the context of one flight. Of drag in measured air, each sample has the entry level and the air of one.

    Args:
        model: Whatever draws standardised weights.
        representation: Its decoder and bounds.
        real: Held-out flights on the decoder's grid.
        context: (flights, c) encoded context of the flights, for a conditional model.
        n: Number of samples.
        seed: Of sampling, and of the splits behind the noise floors.
        name: The model's name in figures.
        n_splits: Random splits behind each noise floor.
        costly: Whether costly statistics are among the scores, see :func:`.metrics.scores.score`.
        draw_budget: Most draws; 100 for each sample (at least 10,000) if absent.
        progress: Progress callback: called with the number of newly accepted samples.
        score_progress: Progress callback: called with 1 after each comparison.

    Raises:
        DataError: If there is no flight to compare with.
        SamplingError: If too few draws are plausible.

    Example:
        >>> from descentflow.densities.checkpoint import load_model
        >>> from descentflow.surveillance.descents.prepared_descents import read_descents
        >>> model = load_model("best.ckpt")
        >>> flights = encode_flights(read_descents("descents.parquet").frame, model.representation)["test"]
        >>> evaluation = evaluate_profiles(model, model.representation, flights.profiles, n=200, n_splits=2)
        >>> len(evaluation.real), evaluation.rejections.accepted
        (24, 200)
    """
    if len(real) == 0:
        raise DataError(
            "no flight to score against",
            expected="flights that the checkpoint was not trained on",
            mend="pass other prepared descents",
        )
    decoder = representation.decoder
    samples = sample_descents(
        model,
        representation,
        n,
        seed,
        context=context,
        entry=real.entry_level,
        air=real.air,
        draw_budget=draw_budget,
        progress=progress,
    )
    observed = DescentSet.of_profiles(real)
    generated = DescentSet.of_trajectories(samples.trajectories, fuel=real.fuel_flow_kg_s is not None)
    nominal = DescentSet.of_nominal(nominal_descent(decoder.aircraft, decoder.levels_fl.cpu()))
    transition_fl = decoder.transition_fl
    count = score_progress or (lambda _: None)
    scores = score(generated, observed, transition_fl, nominal, seed, n_splits, costly=costly, progress=count)
    return Evaluation(name, generated, observed, nominal, scores, samples.report, representation)
