"""A speed that crews hold: one constant of the flight, and small smooth deviations about it.

Mach numbers are seen above a flight's crossover and CAS below it, so no level is seen of all flights. A probabilistic
PCA whose first loading is alike on every level gives the constant from whatever part is seen; the
others hold what flights stray from it. The density is over the constant alone; the deviations come back in samples with
their own variance, and what is observed is weighed with them in mind.
"""

from dataclasses import dataclass
from math import sqrt

import torch
from torch import Tensor

from descentflow.core.errors import DataError
from descentflow.representation.fpca import ppca
from descentflow.representation.fpca.basis import FunctionalBasis
from descentflow.representation.fpca.judged_by_others import roughness_and_length
from descentflow.representation.fpca.mask_groups import MaskGroups, group_masks
from descentflow.representation.fpca.roughness import smoothed

DEVIATIONS = 3
"""Shapes in which flights stray from their constant."""
SHOWN_BY = 0.25
"""Share of the flights that show any that must show a level for it to have a mean and deviations of its own; beyond,
both are held. Who holds CAS high up, or a Mach number low down, flies slowly or fast: levels shown by few have the
deviations of such flights alone. The same share as that by which the grid ends (paper, appendix A)."""
FEWEST_FLIGHTS = 10
"""Flights that must show a level in any case."""
LEAST_LEVELS = 2
"""Levels that must be shown so."""
SAME = 1e-9
"""Spread over the mean below which flights fly at one and the same speed."""
MAX_ITERATIONS, TOLERANCE = 100, 1e-5
"""Bound on the iterations, and mean gain per observed value (nats) at which they end."""


class ConstantBasis(FunctionalBasis):
    """One constant of the flight as the only component; the other loadings are its deviations.

    Example:
        >>> seen = torch.arange(60) < torch.randint(30, 61, (80, 1))
        >>> speed = 140 + 5 * torch.randn(80, 1).double() + 0.2 * torch.randn(80, 60).double()
        >>> basis = fit_constant(speed, seen, spacing_m=30.48)
        >>> basis.n_components, round(float(basis.decode(basis.encode(speed, seen)).std(0).mean()))
        (1, 5)
    """

    def encode(self, values: Tensor, mask: Tensor) -> Tensor:
        """Weights (n, 1) of gappy profiles (n, L): what is expected of the constant given the observed levels."""
        if not len(values):
            return self.mean.new_zeros(0, 1)
        centred = torch.where(mask, values.to(torch.float64) - self.mean, 0.0)
        noise = self.noise_variance * self.noise_length
        latent, _, _ = ppca.posterior(centred, group_masks(mask), self.loadings, noise)
        size = self.loadings[0, 0] / self.components[0, 0]
        found: Tensor = latent[:, :1] * size
        return found

    def left_out(self) -> Tensor:
        """Loadings (L, q) of the deviations."""
        return self.loadings[:, 1:]


def fit_constant(
    values: Tensor, mask: Tensor, spacing_m: float, name: str = "speed", deviations: int = DEVIATIONS
) -> ConstantBasis:
    """Fit constant and deviations to profiles.

    Args:
        values: (n, L); masked values are ignored.
        mask: (n, L) observed.
        spacing_m: Altitude between two levels.
        name: What it is, for an error.
        deviations: Shapes of the deviations, at most.

    Raises:
        DataError: If fewer than two levels are shown by enough flights, or all of them fly at the same speed.

    Example:
        >>> seen = torch.arange(60) < torch.randint(30, 61, (80, 1))
        >>> speed = 140 + 5 * torch.randn(80, 1).double() + 0.2 * torch.randn(80, 60).double()
        >>> fit_constant(speed, seen, spacing_m=30.48).loadings.shape  # the constant and three deviations
        torch.Size([60, 4])
    """
    shown = shown_levels(mask)
    if len(shown) < LEAST_LEVELS:
        raise DataError(
            f"training flights of which {int(mask.any(1).sum())} show a {name}, on {len(shown)} level(s) "
            f"{_fewest(mask):.0f} of them or more",
            expected="flights that hold a Mach number above and a CAS below",
            mend="prepare more descents, or take speed as one CAS profile (data.speed: cas)",
        )
    inner, seen, part = _between_ends(values, mask, shown)
    mean, scale = _mean_and_spread(inner, seen)
    if _is_nothing(scale, mean):
        raise DataError(
            f"training flights that all hold the same {name}: in speed they are identical",
            expected="flights that differ",
            mend="check that the rows come from different flights and are not copies, or take speed as one CAS profile "
            "(data.speed: cas)",
        )
    centred = torch.where(seen, (inner - mean) / scale, 0.0)
    q = min(deviations, len(centred) - 2, centred.shape[1] - 2)

    def fit(some: Tensor, of_them: Tensor) -> ppca.PPCA:
        return constant_em(some, of_them, max(min(q, len(some) - 2), 0))

    fitted = fit(centred, seen)
    weight, length = roughness_and_length(centred, seen, mean / scale, fit)
    fitted = smoothed(fitted, weight, centred, seen, mean / scale)
    ends = (part.start, values.shape[1] - part.stop)
    loadings = _held(fitted.loadings * scale, ends)
    n_levels = len(loadings)
    constant = loadings.new_full((1, n_levels), 1 / sqrt(n_levels * spacing_m))
    power = loadings.square().sum(0)
    return ConstantBasis(
        _held((mean + scale * fitted.shift)[:, None], ends)[:, 0],
        constant,
        loadings,
        fitted.noise_variance * scale**2,
        mean.new_tensor(length),
        power[:1] / power.sum(),
        spacing_m,
    )


def can_be_fitted(values: Tensor, mask: Tensor) -> bool:
    """True where :func:`fit_constant` takes profiles: enough flights show enough levels, and do not all fly alike.

    Args:
        values: (n, L); masked values are ignored.
        mask: (n, L) observed.

    Example:
        >>> seen, mach = torch.ones(20, 5, dtype=torch.bool), 0.78 + 0.01 * torch.randn(20, 1).double().expand(-1, 5)
        >>> can_be_fitted(mach, seen), can_be_fitted(mach, seen[:5]), can_be_fitted(0 * mach + 0.78, seen)
        (True, False, False)
    """
    shown = shown_levels(mask)
    if len(shown) < LEAST_LEVELS:
        return False
    mean, scale = _mean_and_spread(*_between_ends(values, mask, shown)[:2])
    return not _is_nothing(scale, mean)


def shown_levels(mask: Tensor) -> Tensor:
    """Levels (k,) that enough flights show, of a mask (n, L), to have a mean and deviations of their own.

    Example:
        >>> shown_levels(torch.arange(4) < torch.tensor([[2]] * 12 + [[4]]))
        tensor([0, 1])
    """
    return torch.nonzero(mask.sum(0) >= _fewest(mask))[:, 0]


def _between_ends(values: Tensor, mask: Tensor, shown: Tensor) -> tuple[Tensor, Tensor, slice]:
    """Values and mask of the levels from the first shown to the last, of flights that show any; and which levels."""
    part = slice(int(shown[0]), int(shown[-1]) + 1)
    seen = mask[:, part]
    used = seen.any(1)
    return torch.where(seen, values[:, part].to(torch.float64), 0.0)[used], seen[used], part


def _mean_and_spread(values: Tensor, mask: Tensor) -> tuple[Tensor, Tensor]:
    """Mean of each level (L,), and root mean square of what flights show beside it."""
    mean, _ = level_and_flight(values, mask)
    return mean, torch.where(mask, values - mean, 0.0).square().sum().div(mask.sum()).sqrt()


def _is_nothing(spread: Tensor, mean: Tensor) -> bool:
    """True where a spread is no more than rounding."""
    return float(spread) <= SAME * float(mean.abs().max())


def _fewest(mask: Tensor) -> float:
    return max(FEWEST_FLIGHTS, SHOWN_BY * int(mask.any(1).sum()))


def level_and_flight(values: Tensor, mask: Tensor) -> tuple[Tensor, Tensor]:
    """Least squares of profiles by a number for each level (L,) and one for each flight (n,), of mean zero.

    The mean of a level that slow flights alone show is then that of all: other levels tell how slow they are.

    Args:
        values: (n, L); masked values are ignored.
        mask: (n, L) observed; every flight shows a level.

    Example:
        >>> slow_and_fast = torch.tensor([[1.0, 1.5], [3.0, 0.0]]).double()  # the fast one shows no upper level
        >>> level_and_flight(slow_and_fast, torch.tensor([[True, True], [True, False]]))
        (tensor([2.0000, 2.5000], dtype=torch.float64), tensor([-1.,  1.], dtype=torch.float64))
    """
    seen = mask.to(torch.float64)
    shown = torch.where(mask, values, 0.0).to(torch.float64)
    count = seen.sum(1, keepdim=True)
    # The flights' numbers eliminated: what is left are equations for the levels, up to a constant of all of them.
    left = torch.diag(seen.sum(0)) - seen.T @ (seen / count)
    right = (shown - seen * shown.sum(1, keepdim=True) / count).sum(0)
    levels = torch.linalg.pinv(left, hermitian=True) @ right
    own = ((shown - seen * levels).sum(1, keepdim=True) / count)[:, 0]
    return levels + own.mean(), own - own.mean()


@dataclass(frozen=True)
class _Moments:
    """By level: of the latent numbers and a column of ones (L, q + 2, q + 2), and with the values (L, q + 2)."""

    design: Tensor
    cross: Tensor


def constant_em(centred: Tensor, mask: Tensor, q: int) -> ppca.PPCA:
    """Probabilistic PCA by EM whose first loading is alike on all levels, and whose others average to zero over them.

    Each M step takes the lines of the other loadings and of the mean given the constant's, then the constant's given
    the lines (Meng and Rubin 1993, doi:10.1093/biomet/80.2.267).

    Args:
        centred: (n, L) float64 values minus the observed mean, zero where missing.
        mask: (n, L) observed.
        q: Loadings beside the constant.

    Example:
        >>> curves = 3 * torch.randn(300, 1).double() + 0.1 * torch.randn(300, 40).double()
        >>> seen = torch.rand(300, 40) < 0.8
        >>> fitted = constant_em(torch.where(seen, curves, 0.0), seen, q=1)
        >>> fitted.loadings[:, 0].unique().numel(), round(float(fitted.loadings[0, 0]))
        (1, 3)
    """
    groups = group_masks(mask)
    counts = mask.sum(0).to(centred)
    shift, own = level_and_flight(centred, mask)
    left = torch.where(mask, centred - shift - own[:, None], 0.0)
    free, noise = ppca.closed_form(ppca.pairwise_covariance(left, mask), q)
    loadings = torch.cat([own.std().expand(len(counts), 1), free], 1)
    fits: list[float] = []
    total, n_observed = centred.square().sum(), mask.sum()
    for _ in range(MAX_ITERATIONS):
        shown = torch.where(mask, centred - shift, 0.0)
        fits.append(float(ppca.log_likelihood(shown, mask, loadings, noise) / n_observed))
        if len(fits) > 1 and fits[-1] - fits[-2] < TOLERANCE:
            return ppca.PPCA(loadings, noise, shift, fits, converged=True)
        means, covariance, _ = ppca.posterior(shown, groups, loadings, noise)
        found = _moments(centred, groups, means, covariance)
        loadings, noise, shift = _maximised(found, loadings[0, 0], counts, total, n_observed, means.mean(0))
    return ppca.PPCA(loadings, noise, shift, fits, converged=False)


def _moments(centred: Tensor, groups: MaskGroups, means: Tensor, covariance: Tensor) -> _Moments:
    q = means.shape[1]
    counts = torch.bincount(groups.group, minlength=len(groups.masks)).to(means)
    design = torch.cat([means, torch.ones_like(means[:, :1])], 1)
    moments = counts[:, None] * torch.nn.functional.pad(covariance, (0, 1, 0, 1)).flatten(1)
    moments.index_add_(0, groups.group, (design[:, :, None] * design[:, None, :]).flatten(1))
    return _Moments((groups.masks.T @ moments).reshape(-1, q + 1, q + 1), centred.T @ design)


def _maximised(
    found: _Moments, constant: Tensor, counts: Tensor, total: Tensor, n_observed: Tensor, of_latent: Tensor
) -> tuple[Tensor, Tensor, Tensor]:
    """Loadings, noise variance and shift of the mean."""
    design, cross = found.design, found.cross
    inner = design[:, 1:, 1:]
    ridge = 1e-8 * inner.diagonal(dim1=-2, dim2=-1).mean(-1).clamp(min=1e-8)
    inner = inner + ridge[:, None, None] * torch.eye(inner.shape[1]).to(inner)
    lines = torch.linalg.solve(inner, cross[:, 1:] - constant * design[:, 1:, 0])
    free = lines[:, :-1]
    # What all levels have in common is the constant's.
    free = free - (counts @ free) / counts.sum()
    lines = torch.cat([free, lines[:, -1:]], 1)
    constant = (cross[:, 0] - (design[:, 0, 1:] * lines).sum(1)).sum() / design[:, 0, 0].sum()
    whole = torch.cat([constant.expand(len(lines), 1), lines], 1)
    left = total - 2 * (whole * cross).sum() + torch.einsum("lu,luv,lv->", whole, design, whole)
    loadings = whole[:, :-1]
    noise = (left / n_observed).clamp(min=1e-10 * float(total / n_observed))
    return loadings, noise, whole[:, -1] + loadings @ of_latent


def _held(curves: Tensor, ends: tuple[int, int]) -> Tensor:
    """Curves (L, q) of some levels on more of them: their ends held."""
    below, above = ends
    return torch.cat([curves[:1].expand(below, -1), curves, curves[-1:].expand(above, -1)])
