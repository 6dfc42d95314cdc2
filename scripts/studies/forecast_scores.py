"""Scores of a density as a forecast of each held-out flight, given its context or not: what conditioning is worth."""

from dataclasses import dataclass
from typing import Any

import torch
from torch import Tensor

from descentflow.core.errors import ConfigError, DataError
from descentflow.core.units import FPM_MPS, KT_MPS
from descentflow.densities.density import Density
from descentflow.generation.rejection import sample_descents
from descentflow.representation.linear_curves import evidence_of
from descentflow.representation.profiles import Profiles


def crps_each(samples: Tensor, real: Tensor) -> Tensor:
    """Fair CRPS of every flight's own samples, ``mean |X - y| - 1/2 mean |X - X'|`` over distinct pairs.

    Args:
        samples: (n, m, ...) m samples for each of n flights.
        real: (n, ...) what came.

    Returns:
        (n, ...) in the unit of the values.

    Raises:
        ConfigError: If there are fewer than two samples a flight.

    Example:
        >>> crps_each(torch.tensor([[0.0, 2.0]]), torch.tensor([1.0]))
        tensor([0.])
    """
    m = samples.shape[1]
    _at_least_two(m)
    across = (samples - real[:, None]).abs().mean(1)
    # The sum over pairs of |x - x'| is a weighted sum of the ordered values.
    rank = torch.arange(m, dtype=samples.dtype, device=samples.device)
    weight = (2 * rank - m + 1).reshape(m, *([1] * (samples.ndim - 2)))
    within = (samples.sort(1).values * weight).sum(1) * 2 / (m * (m - 1))
    return across - within / 2


def energy_score_each(samples: Tensor, real: Tensor) -> Tensor:
    """Fair energy score (n,) of every flight's own samples (n, m, d) at real (n, d): the CRPS in several dimensions.

    Raises:
        ConfigError: If there are fewer than two samples a flight.

    Example:
        >>> energy_score_each(torch.tensor([[[0.0, 0.0], [0.0, 2.0]]]), torch.tensor([[0.0, 1.0]]))
        tensor([0.])
    """
    m = samples.shape[1]
    _at_least_two(m)
    across = (samples - real[:, None]).norm(dim=2).mean(1)
    within = [torch.cdist(one, one, compute_mode="donot_use_mm_for_euclid_dist").sum() for one in samples]
    score: Tensor = across - torch.stack(within) / (m * (m - 1)) / 2
    return score


def _at_least_two(m: int) -> None:
    if m < 2:
        raise ConfigError(f"{m} sample(s) a flight", expected="two at the least", mend="draw more for every flight")


@dataclass(frozen=True)
class _WithoutContext:
    """A density that ignores the context of the flights that it is asked for."""

    density: Density

    def sample(self, n: int, seed: int, context: Tensor) -> Tensor:
        """Draw (n, d) weights."""
        return self.density.sample(n, seed)


@torch.no_grad()
def forecast_scores(
    density: Density, flights: Profiles, weights: Tensor, context: Tensor, n_draws: int = 100, seed: int = 0
) -> dict[str, Tensor]:
    """Proper scores flight by flight; lower is better.

    The samples are plausible descents from each flight's own entry level, as a user would draw them.

    Args:
        density: With its representation.
        flights: Held-out flights on its grid, n of them.
        weights: (n, d) their standardised weights.
        context: (n, c) their context; c is 0 where the density takes none.
        n_draws: Samples a flight.
        seed: Of the samples.

    Returns:
        (n,) tensors: ``nll`` in nats of what was observed, ``energy`` of the standardised weights, ``crps_cas_kt`` and
        ``crps_rate_fpm`` as means over a flight's levels, ``crps_time_s`` of the time from its highest level to the
        lowest of the grid, NaN where that level was not observed.

    Raises:
        DataError: If there is no flight.
        SamplingError: If too few draws are plausible.

    Example:
        >>> from descentflow.densities.checkpoint import load_model
        >>> from descentflow.representation.encode_flights import encode_flights
        >>> from descentflow.surveillance.descents.prepared_descents import read_descents
        >>> model = load_model("best.ckpt")
        >>> flights = encode_flights(read_descents("descents.parquet").frame, model.representation)["test"]
        >>> forecast_scores(model, flights.profiles, flights.weights, flights.context, n_draws=10)["nll"].shape
        torch.Size([24])
    """
    if len(flights) == 0:
        raise DataError("no flight to score", expected="held-out flights", mend="pass other descents")
    parts, n = density.representation, len(flights)
    own = context if context.shape[1] else weights.new_zeros(n, 1)
    model: Any = density if context.shape[1] else _WithoutContext(density)
    samples = sample_descents(
        model,
        parts,
        n * n_draws,
        seed,
        context=own,
        entry=flights.entry_level,
        air=flights.air,
    )

    def by_flight(values: Tensor) -> Tensor:
        return values.reshape(n_draws, n, *values.shape[1:]).transpose(0, 1)

    flown = samples.trajectories
    log_prob = density.log_observed(evidence_of(parts.decoder, flights), context)
    mask = flights.mask
    cas = crps_each(by_flight(flown.cas_mps), flights.cas_mps) / KT_MPS
    rate = crps_each(by_flight(flown.rate_mps), flights.rate_mps) / FPM_MPS
    took = flights.time_s[:, 0] - flights.time_s.gather(1, flights.entry_level[:, None])[:, 0]
    time = crps_each(by_flight(flown.time_s[:, 0]), took)
    return {
        "nll": -log_prob.double(),
        "energy": energy_score_each(by_flight(samples.weights), weights),
        "crps_cas_kt": torch.where(mask, cas, 0.0).sum(1) / mask.sum(1),
        "crps_rate_fpm": torch.where(mask, rate, 0.0).sum(1) / mask.sum(1),
        "crps_time_s": torch.where(mask[:, 0], time, torch.nan),
    }


@dataclass(frozen=True)
class Skill:
    """Mean of a score's difference over flights, with its 90 % bootstrap interval; below zero the first is better.

    Example:
        >>> print(Skill(mean=-0.5, low=-0.7, high=-0.3))
        -0.500 [-0.700, -0.300]
    """

    mean: float
    low: float
    high: float

    def __str__(self) -> str:
        """Mean and interval."""
        return f"{self.mean:+.3f} [{self.low:+.3f}, {self.high:+.3f}]"


def skill(scores: Tensor, reference: Tensor, seed: int = 0, n_resamples: int = 2000) -> Skill:
    """Improvement of a model over a reference on the same flights, for scores where lower is better.

    Args:
        scores: (n,) of the model, flight by flight (negative log density, CRPS, energy score).
        reference: (n,) of the reference.
        seed: Of the resampling.
        n_resamples: Resamples of the flights, with replacement.

    Example:
        >>> skill(torch.tensor([1.0, 2.0]), torch.tensor([2.0, 3.0])).mean
        -1.0
    """
    difference = (scores - reference).double()
    generator = torch.Generator().manual_seed(seed)
    chosen = torch.randint(len(difference), (n_resamples, len(difference)), generator=generator)
    low, high = difference[chosen].mean(1).quantile(torch.tensor([0.05, 0.95]).double()).tolist()
    return Skill(float(difference.mean()), low, high)
