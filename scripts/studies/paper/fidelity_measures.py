r"""Spread of samples at the top of descents, and coverage of intervals in flight, on held-out flights.

The spread at the top compares standard deviations within levels,

.. math:: \sqrt{\sum_l n_l s_l^2(\text{samples}) / \sum_l n_l s_l^2(\text{flights})},

over the highest 3,000 ft of the grid, with :math:`n_l` flights at level l: a density that is fitted to the most
probable profile of flights with hidden levels varies too little there. Next to it stands the same number of the
training flights in place of the samples, which tells how much of it is chance: at the top of a small type are some
hundred flights. The intervals: the share of flights whose time to a level lay inside its 90 % interval, predicted from
what was flown above.

The time to the bottom is of flights without gaps, as the paper has it. Those are not like the others: cleaning leaves
gaps where a rate was held, which slow flights do more often. So the time on the levels that flights show is compared as
well, of all flights, with samples that have the gaps of a flight which enters as high.
"""

import json
from pathlib import Path

import polars as pl
import torch

from descentflow.core.files import write_whole
from descentflow.core.tabular import write_table
from descentflow.densities.checkpoint import load_model
from descentflow.densities.density import Density
from descentflow.evaluation.evaluate import N_SPLITS, evaluate
from descentflow.evaluation.metrics.classifier import pairs_by_entry
from descentflow.evaluation.metrics.descent_set import DescentSet
from descentflow.evaluation.metrics.noise_floor import split_distances
from descentflow.generation.prediction.predict import predict
from descentflow.representation.encode_flights import encode_flights, split_by_model
from descentflow.surveillance.descents.prepared_descents import read_descents
from descentflow.surveillance.open_descents import FlightSource
from studies.paper.study_plan import StudyPlan

TOP_FL = 30.0
"""Depth of what is called the top: 3,000 ft."""
FEWEST_LEGS = 20
"""Steps from one level to the next, 2,000 ft in all, that a flight must show to say how fast it descends."""
FEWEST = 10
"""Flights at a level below which no spread is computed."""
OBSERVED = (0.75, 0.5)
"""Shares of the grid's height at which a flight is predicted from: below the top of descent, and half-way down."""
MOST_FLIGHTS = 1_000
"""Flights that are predicted: a share of 90 % is then known to 1 %."""
CONTINUATIONS = 300
SAMPLES = 5_000
"""Two standard deviations are compared, not two tails: half of the paper's 10,000 are enough."""


def top_spread(samples: DescentSet, real: DescentSet) -> dict[str, float]:
    """Standard deviation of samples over that of flights within levels of the highest 3,000 ft, by quantity.

    Args:
        samples: Sampled descents.
        real: Held-out flights on the same grid.

    Returns:
        ``rate`` and ``cas``; NaN where no level has flights enough.

    Example:
        >>> from descentflow.evaluation.evaluate import evaluate
        >>> found = evaluate("best.ckpt", "descents.parquet", n=200)
        >>> sorted(top_spread(found.real, found.real).items())
        [('cas', 1.0), ('rate', 1.0)]
    """
    top = real.levels_fl > real.levels_fl[-1] - TOP_FL
    n = real.mask[:, top].sum(0)
    enough = (n >= FEWEST) & (samples.mask[:, top].sum(0) >= FEWEST)
    weight = torch.where(enough, n, 0).double()
    ratios = {}
    for name, of in (("rate", "rate_mps"), ("cas", "cas_mps")):
        variances = []
        for side in (samples, real):
            values, mask = getattr(side, of)[:, top].double(), side.mask[:, top]
            count = mask.sum(0).clamp(min=2)
            mean = torch.where(mask, values, 0.0).sum(0) / count
            square = torch.where(mask, values - mean, 0.0).square().sum(0) / (count - 1)
            variances.append(float((weight * torch.where(enough, square, 0.0)).sum()))
        ratios[name] = (variances[0] / variances[1]) ** 0.5 if variances[1] > 0 else float("nan")
    return ratios


def time_shown(samples: DescentSet, real: DescentSet, seed: int = 0, n_splits: int = N_SPLITS) -> dict[str, float]:
    """Distance over its noise floor of the mean time from one level to the next, on the levels that flights show.

    Args:
        samples: Sampled descents.
        real: Held-out flights on the same grid.
        seed: Of pairs and splits.
        n_splits: Random splits behind the noise floor.

    Returns:
        ``ks`` and ``wasserstein``; NaN where too few flights show two thousand feet.

    Example:
        >>> from descentflow.evaluation.evaluate import evaluate
        >>> found = evaluate("best.ckpt", "descents.parquet", n=200)
        >>> sorted(time_shown(found.samples, found.real))
        ['ks', 'wasserstein']
    """
    drawn, judged = pairs_by_entry(samples, real, torch.Generator().manual_seed(seed), most=len(real))
    seen = samples.mask[drawn] & real.mask[judged]
    legs = seen[:, 1:] & seen[:, :-1]
    n_legs = legs.sum(1, keepdim=True)
    means = []
    for side, index in ((samples, drawn), (real, judged)):
        time_s = torch.where(legs, -side.time_s[index].diff(dim=1), 0.0).sum(1, keepdim=True)
        means.append((time_s / n_legs.clamp(min=1), n_legs >= FEWEST_LEGS))
    same, floor = split_distances(*means, seed=seed, n_splits=n_splits)
    return {name: float(same[name].mean() / floor[name].mean()) for name in ("ks", "wasserstein")}


def in_flight(model: Density, descents: Path, seed: int = 0, flights: int = MOST_FLIGHTS) -> pl.DataFrame:
    """Coverage of 90 % intervals of the time to each level, predicted from two levels.

    Args:
        model: What predicts.
        descents: Prepared; flights that the model has seen are left out.
        seed: Of the predictions, and of which flights are predicted where there are more than ``flights``.
        flights: Most flights.

    Returns:
        Columns ``from_fl level_fl flights covered``.

    Raises:
        DataError: If no flight can be predicted.

    Example:
        >>> from descentflow.densities.checkpoint import load_model
        >>> in_flight(load_model("best.ckpt"), Path("descents.parquet"), flights=10).columns
        ['from_fl', 'level_fl', 'flights', 'covered']
    """
    levels = model.representation.decoder.levels_fl
    source = read_descents(descents)
    unseen = split_by_model(source.frame, sorted(source.frame["flight_id"].unique()), model.representation).test
    order = torch.randperm(len(unseen), generator=torch.Generator().manual_seed(seed)).tolist()
    chosen = [unseen[i] for i in order[:flights]]
    tables = []
    for share in OBSERVED:
        from_fl = round(float(levels[0]) + share * float(levels[-1] - levels[0]))
        ahead = predict(model, source, from_fl, n=CONTINUATIONS, seed=seed, flights=chosen)
        tables.append(ahead.coverage().with_columns(pl.lit(from_fl).alias("from_fl")))
    return pl.concat(tables).select("from_fl", "level_fl", "flights", "covered")


def measure(plan: StudyPlan, name: str, folder: Path) -> None:
    """Leave ``fidelity.json`` and ``in_flight.csv`` of one model of a type whose study is done.

    Args:
        plan: The study.
        name: One of its models.
        folder: The type's folder.

    Raises:
        DescentflowError: If the checkpoint cannot be used, too few draws are plausible, or no flight can be predicted.

    Example:
        >>> measure(StudyPlan({"A320": 120}), "gmm", Path("no_study"))
        Traceback (most recent call last):
            ...
        descentflow.core.errors.CheckpointError: ...no_study/gmm/model.ckpt...
    """
    place = folder / name
    model = load_model(place / "model.ckpt")
    scored = evaluate(model, folder / "descents.parquet", n=SAMPLES, seed=plan.seed, n_splits=2)
    ahead = in_flight(model, folder / "descents.parquet", plan.seed)
    spread = {f"top_spread_{quantity}": value for quantity, value in top_spread(scored.samples, scored.real).items()}
    trained = top_spread(_training_flights(model, folder / "descents.parquet"), scored.real)
    spread |= {f"top_spread_{quantity}_of_training": value for quantity, value in trained.items()}
    shown = time_shown(scored.samples, scored.real, plan.seed)
    spread |= {f"time_shown/{name}": value for name, value in shown.items()}
    write_table(ahead, place / "in_flight.csv")
    kept = 1 - scored.rejections.rejected / scored.rejections.drawn
    write_whole(place / "fidelity.json", json.dumps({**spread, "kept": kept}))


def _training_flights(model: Density, descents: Path) -> DescentSet:
    known = model.representation
    frame = FlightSource(descents).for_model(known.cleaning, float(known.decoder.levels_fl[0])).frame
    parts = encode_flights(frame, known)
    return DescentSet.of_profiles(parts["train"].profiles)
