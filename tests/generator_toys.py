"""A mixture over toy descents on few levels, and what brute force finds: samples, cut to what is asked."""

from collections.abc import Callable
from functools import cache
from typing import Any

import torch
import toys
from scipy.stats import ks_2samp
from torch import Tensor

from descentflow.core.units import KT_MPS
from descentflow.densities.mixture import GaussianMixtureDensity
from descentflow.densities.mixture_parameters import Mixture
from descentflow.generation.rejection import DRAWN_ENTRIES, sample_descents
from descentflow.positions.placing import place
from descentflow.representation.decoder.trajectories import Trajectories, concatenate
from descentflow.representation.fit_representation import RepresentationSettings, fit_representation
from descentflow.representation.representation import Representation, Split

BOTTOM, TOP = 270, 370
RARE = 1e-4
"""Of p-values: one right sampler in 10,000 fails a comparison of one quantity."""


@cache
def parts() -> Representation:
    """Parts that all tests share and none changes."""
    return fitted()


@cache
def state() -> dict[str, Any]:
    """Two components of CAS at least, so that two speeds can be asked, and drag beyond the components."""
    train = toys.flights(300, bottom_fl=BOTTOM, top_fl=TOP)
    split = Split(train.flight_ids, (), ())
    return fit_representation(train, toys.AIRCRAFT, split, RepresentationSettings(explained_variance=0.97)).to_state()


def fitted() -> Representation:
    """A representation of one's own."""
    return Representation.from_state(state())


def mixture() -> GaussianMixtureDensity:
    """Two components about the mean flight, one of them wide: many of its draws are not plausible.

    A density of one's own, for some tests attach another representation to it.
    """
    d = parts().decoder.dimension
    density = GaussianMixtureDensity(d, 2)
    locs = torch.zeros(2, d, dtype=torch.float64)
    locs[0], locs[1] = 0.5, -0.6
    generator = torch.Generator().manual_seed(0)
    mixed = 0.3 * torch.randn(2, d, d, generator=generator, dtype=torch.float64).tril(-1)
    roots = mixed + torch.tensor([0.5, 1.1]).double()[:, None, None] * torch.eye(d, dtype=torch.float64)
    density.mixture = Mixture(torch.tensor([0.6, 0.4]).double(), locs, roots)
    density.attach(parts())
    return density


def index(level_fl: float) -> int:
    return int(level_fl - BOTTOM)


@cache
def samples(entry_fl: int | None, n: int = 40_000) -> Trajectories:
    """Samples as anyone draws them."""
    entry, known = DRAWN_ENTRIES if entry_fl is None else torch.tensor([index(entry_fl)]), parts()
    density = mixture()
    parts_of = [sample_descents(density, known, 10_000, seed, entry=entry).trajectories for seed in range(n // 10_000)]
    return concatenate(parts_of)


def cut(flown: Trajectories, meets: Callable[[Trajectories], Tensor]) -> Trajectories:
    """Those that meet what is asked: enough to tell a wrong law."""
    kept = flown.subset(meets(flown))
    assert len(kept) > 400
    return kept


def cas_kt(flown: Trajectories, level_fl: float) -> Tensor:
    return flown.cas_mps[:, index(level_fl)] / KT_MPS


def distance_nm(flown: Trajectories, level_fl: float) -> Tensor:
    return torch.from_numpy(place(flown).distance_m[:, index(level_fl)] / 1852.0)


def comparisons(one: Trajectories, other: Trajectories) -> dict[str, tuple[float, float]]:
    """Distance and p of two-sample Kolmogorov-Smirnov tests of what the descents have at some levels."""
    by_name = {}
    for name, of in {
        "time to the bottom": lambda t: t.time_s[:, 0],
        "time to FL300": lambda t: t.time_s[:, index(300)],
        "CAS at FL275": lambda t: cas_kt(t, 275),
        "CAS at FL320": lambda t: cas_kt(t, 320),
        "drag at FL290": lambda t: t.drag_n[:, index(290)],
        "entry": lambda t: t.entry.double(),
    }.items():
        first, second = of(one).round(decimals=6), of(other).round(decimals=6)
        test = ks_2samp(first.numpy(), second.numpy(), method="asymp")
        by_name[name] = float(test.statistic), float(test.pvalue)
    return by_name


def p_values(first: Trajectories, other: Trajectories) -> dict[str, float]:
    """The p of :func:`comparisons`."""
    return {name: p for name, (_, p) in comparisons(first, other).items()}
