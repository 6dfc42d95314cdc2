"""Sweep of the variance that the components explain (paper, appendix B): mixtures judged on held-out folds.

Where speed is held as a Mach number and a CAS, each is a constant of the flight, and the share is that of drag alone.
"""

from dataclasses import asdict, dataclass
from typing import Any

import polars as pl
import torch
from torch import Tensor

from descentflow.core.errors import DescentflowError
from descentflow.core.units import FL_M
from descentflow.densities.component_search import select_mixture
from descentflow.densities.mixture import GaussianMixtureDensity
from descentflow.densities.one_gaussian import drawn_weights, one_gaussian
from descentflow.evaluation.metrics.descent_set import DescentSet
from descentflow.evaluation.metrics.scores import score
from descentflow.generation.rejection import sample_descents
from descentflow.physics.performance_model import PerformanceModel
from descentflow.representation.drag_scale import DragScale, fit_drag_scale
from descentflow.representation.fit_representation import standardised_decoder
from descentflow.representation.fpca.basis import FunctionalBasis
from descentflow.representation.fpca.gappy import LATENT_DIMENSION, fit_components
from descentflow.representation.linear_curves import evidence_of
from descentflow.representation.plausibility import Plausibility
from descentflow.representation.profiles import Profiles
from descentflow.representation.representation import Representation, Split
from studies.paper.study_plan import PAPER_STATISTICS

Bases = tuple[FunctionalBasis, FunctionalBasis]
"""Of drag and of CAS."""
SAMPLES = 1_000
RESTARTS = 2
"""k-means++ starts of each mixture: 65 mixtures per share are compared, and none is kept."""
QUANTITIES = ("rocd_above_transition", "rocd_below_transition")


@dataclass(frozen=True)
class _FoldScore:
    """Scores of one fold at one share; NaN where no sample was plausible or a quantity has no level."""

    share: float
    fold: int
    components: int
    clusters: int
    quantity: str
    statistic: str
    unit: str
    score: float


def fold_scores(
    profiles: Profiles,
    aircraft: PerformanceModel,
    transition_fl: float,
    fold: int,
    folds: int,
    shares: tuple[float, ...],
) -> pl.DataFrame:
    """Fit a mixture to all folds but one at every share of variance, and score its samples against that one.

    Args:
        profiles: Flights of a training part.
        aircraft: Their coefficients.
        transition_fl: Transition level of the type.
        fold: Which fold is held out, from 0.
        folds: How many there are.
        shares: Shares of variance to be explained.

    Returns:
        One row per share, quantity and statistic, with the columns ``share fold components clusters quantity
        statistic unit score``; scores are NaN where no sample was plausible or a quantity has no level.

    Example:
        >>> from descentflow.aircraft_types.open_types.open_aircraft import open_aircraft
        >>> from descentflow.representation.profiles import profiles_from_frame
        >>> from descentflow.surveillance.descents.prepared_descents import read_descents
        >>> aircraft = open_aircraft("A320")
        >>> profiles = profiles_from_frame(read_descents("descents.parquet").frame, aircraft, 250, 300)
        >>> found = fold_scores(profiles, aircraft, transition_fl=275.0, fold=0, folds=2, shares=(0.5,))
        >>> len(found), found["statistic"].unique(maintain_order=True).to_list()
        (6, ['ks', 'wasserstein', 'mae'])
    """
    order = torch.randperm(len(profiles), generator=torch.Generator().manual_seed(0))
    held_out = order[fold::folds]
    rest = order[~torch.isin(order, held_out)]
    train, test = profiles.subset(rest.sort().values), profiles.subset(held_out.sort().values)
    scale = fit_drag_scale(train, aircraft, "newton")
    bases = _bases(train, scale, shares)
    rows: list[_FoldScore] = []
    for share in shares:
        representation = _representation(train, aircraft, scale, bases[share])
        rows += _one_share(representation, train, test, transition_fl, share, fold)
    return pl.DataFrame([asdict(row) for row in rows])


def truncated(basis: FunctionalBasis, share: float) -> FunctionalBasis:
    """The leading components of a basis that explain a smaller share of its variance.

    Example:
        >>> from descentflow.densities.checkpoint import load_model
        >>> basis = load_model("best.ckpt").representation.decoder.drag_basis
        >>> truncated(basis, 0.5).n_components < basis.n_components
        True
    """
    cumulative = basis.explained_variance.cumsum(0)
    k = min(int((cumulative < share - 1e-12).sum()) + 1, basis.n_components)
    return FunctionalBasis(
        basis.mean,
        basis.components[:k],
        basis.loadings,
        basis.noise_variance,
        basis.noise_length,
        basis.explained_variance[:k],
        basis.spacing_m,
    )


def _bases(
    train: Profiles, scale: DragScale, shares: tuple[float, ...]
) -> dict[float, tuple[FunctionalBasis, FunctionalBasis]]:
    """Bases of drag and of speed for each share, in the order of the weights; drag as the paper has it."""
    observed = scale.observed(train)
    drag, cas = (_truncated_bases(values, observed.mask, shares) for values in observed.values)
    return {share: (drag[share], cas[share]) for share in shares}


def _truncated_bases(values: Tensor, mask: Tensor, shares: tuple[float, ...]) -> dict[float, FunctionalBasis]:
    """A basis for each share; one fit serves all shares that its latent dimension serves anyway."""
    bases: dict[float, FunctionalBasis] = {}
    fitted: FunctionalBasis | None = None
    for share in sorted(shares, reverse=True):
        if fitted is None or fitted.loadings.shape[1] > LATENT_DIMENSION:
            fitted = fit_components(values, mask, FL_M, share)
        bases[share] = truncated(fitted, share)
    return bases


def _representation(train: Profiles, aircraft: PerformanceModel, scale: DragScale, bases: Bases) -> Representation:
    decoder = standardised_decoder(train, aircraft, bases, scale)
    return Representation(decoder, Plausibility.from_profiles(train), Split((), (), ()), {})


def _one_share(
    parts: Representation, train: Profiles, test: Profiles, transition_fl: float, share: float, fold: int
) -> list[_FoldScore]:
    evidence = evidence_of(parts.decoder, train)
    weights = drawn_weights(one_gaussian(evidence), evidence, fold)
    mixture = select_mixture(weights, seed=fold, n_restarts=RESTARTS).mixture
    density = GaussianMixtureDensity(mixture.locs.shape[1], len(mixture.probs))
    density.mixture = mixture
    about: dict[str, Any] = {
        "share": share,
        "fold": fold,
        "components": mixture.locs.shape[1],
        "clusters": len(mixture.probs),
    }
    try:
        drawn = sample_descents(density, parts, SAMPLES, fold, entry=test.entry_level)
    except DescentflowError:
        # Too many components for the flights: hardly a draw is plausible, which is a result.
        return [_FoldScore(**about, quantity=q, statistic="ks", unit="1", score=float("nan")) for q in QUANTITIES]
    sampled, real = DescentSet.of_trajectories(drawn.trajectories), DescentSet.of_profiles(test)
    scores = score(sampled, real, transition_fl, n_splits=1)
    return [
        _FoldScore(**about, quantity=s.quantity, statistic=s.statistic, unit=s.unit, score=s.score)
        for s in scores
        if s.quantity in QUANTITIES and s.statistic in PAPER_STATISTICS
    ]
