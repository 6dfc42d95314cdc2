"""At which stage a simulator loses what the flights show: a ladder of substitutions that telescopes."""

import polars as pl
import torch
from torch import Tensor

from descentflow.diagnosis.findings.gap_found import Stage
from descentflow.diagnosis.simulator import Simulator
from descentflow.generation.rejection import sample_descents
from descentflow.representation.profiles import Profiles, profiles_from_frame

SAMPLES = 2000
"""Drawn for the stages of density and rejection."""
LEVELS_IN_LEG = 15
"""Levels over which times are compared: 1,500 ft, most of a minute of descent."""


def stages_of(simulator: Simulator, frame: pl.DataFrame, seed: int) -> list[Stage]:
    """Share of each stage in the loss of times along the grid.

    The ladder, from the flights as observed to the samples: flown from their own inferred drag and CAS (measurement:
    reported rates against times); from their components (representation); with the drag of the sample of the nearest
    speed (coupling); all from draws (density); plausible ones alone (rejection). A rung is the distance between its two
    ends, so they add up to at least the whole. What is inferred by an equation is hidden from all of them but the last:
    the share of ``decoder`` is what the flights' own inferred drag departs from the samples' at equal speed.

    Args:
        simulator: With a representation; without one there are no stages.
        frame: Prepared descents.
        seed: Of the samples.

    Returns:
        The stages with their shares and their distances; none for a nominal simulator.

    Example:
        >>> from descentflow.diagnosis.open_simulator import open_simulator
        >>> from descentflow.surveillance.descents.prepared_descents import read_descents
        >>> stages = stages_of(open_simulator("best.ckpt"), read_descents("descents.parquet").frame, seed=0)
        >>> [stage.name for stage in stages]
        ['measurement', 'representation', 'coupling', 'density', 'rejection', 'decoder']
    """
    parts = simulator.representation
    if parts is None or simulator.sampler is None:
        return []
    decoder = parts.decoder
    low, high = int(decoder.levels_fl[0]), int(decoder.levels_fl[-1])
    flights = profiles_from_frame(frame, decoder.aircraft, low, high)
    flights = flights.subset(torch.nonzero(flights.mask.sum(1) >= 2)[:, 0])
    with torch.no_grad():
        weights = decoder.encode(flights)
        entry = flights.entry_level
        own = _legs(_from_rates(flights), flights.mask)
        components = _legs(decoder(weights, entry).time_s, flights.mask)
        draws = simulator.sampler.sample(SAMPLES, seed).to(weights)
        n_drag = decoder.drag_basis.n_components
        near = torch.cdist(weights[:, n_drag:], draws[:, n_drag:]).argmin(1)
        mixed = torch.cat([draws[near, :n_drag], weights[:, n_drag:]], 1)
        coupled = _legs(decoder(mixed, entry).time_s, flights.mask)
        generator = torch.Generator().manual_seed(seed)
        whose = torch.randint(len(entry), (SAMPLES,), generator=generator)
        free = _legs(decoder(draws, entry[whose]).time_s, flights.mask[whose])
        kept = sample_descents(simulator.sampler, parts, SAMPLES, seed, entry=entry)
        accepted = _legs(kept.trajectories.time_s.double(), kept.trajectories.mask)
    observed = _legs(flights.time_s, flights.mask)
    seconds = {
        "measurement": _apart(observed, own),
        "representation": _apart(own, components),
        "coupling": _apart(components, coupled),
        "density": _apart(coupled, free),
        "rejection": _apart(free, accepted),
        "decoder": abs(float((own.nanmean(0) - coupled.nanmean(0)).nan_to_num(0.0).abs().mean())),
    }
    total = sum(seconds.values())
    return [Stage(name, value / total if total > 0 else 0.0, value) for name, value in seconds.items()]


def _from_rates(flights: Profiles) -> Tensor:
    """Times (n, L) that the reported rates give; NaN where not seen."""
    slowness = torch.where(flights.mask, -1 / flights.rate_mps.clamp(max=-0.5), torch.nan)
    steps = flights.altitude_m.diff()
    legs = 0.5 * (slowness[:, 1:] + slowness[:, :-1]) * steps
    return -torch.nn.functional.pad(legs.nan_to_num(0.0).cumsum(1), (1, 0))


def _legs(time_s: Tensor, mask: Tensor) -> Tensor:
    """Seconds (n, legs) between levels some apart, of flights that were seen at every level between."""
    step = LEVELS_IN_LEG
    at = torch.arange(0, time_s.shape[1] - step, step)
    whole = torch.stack([mask[:, i : i + step + 1].all(1) for i in at.tolist()], 1)
    return torch.where(whole, (time_s[:, at] - time_s[:, at + step]).double(), torch.nan)


def _apart(first: Tensor, second: Tensor) -> float:
    """Mean over legs of the Wasserstein distance, in seconds."""
    q = torch.linspace(0.02, 0.98, 25, dtype=torch.float64)
    a, b = torch.nanquantile(first, q, dim=0), torch.nanquantile(second, q, dim=0)
    return float((a - b).abs().nanmean(0).nan_to_num(0.0).mean())
