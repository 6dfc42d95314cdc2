"""Gappy functional PCA judged on levels that were hidden from it: mean fill, the paper's iteration, ridge, PPCA."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import torch
from torch import Tensor

from descentflow.core.errors import DataError
from descentflow.core.units import FL_M
from descentflow.representation.fpca.basis import FunctionalBasis
from descentflow.representation.fpca.gappy import fit_components
from descentflow.representation.fpca.ppca import observed_mean
from descentflow.representation.fpca.roughness import hide_tops, highest, spared

Pattern = Literal["top", "random", "slow"]
MOST_HIDDEN = 0.9
"""Share of its levels that a flight loses at most."""
PATTERNS: tuple[Pattern, ...] = ("top", "random", "slow")
"""Gaps that do not depend on the flight, and tops that slow flights alone do not show."""
METHODS = ("mean fill", "iteration (paper)", "ridge", "probabilistic PCA")
"""In the order of figures."""
RIDGES = tuple(10.0**power for power in range(-6, 1))
"""Penalties tried, in units of the components' own precision; the best on the training flights is taken."""


@dataclass(frozen=True)
class HiddenError:
    """Root mean square error on hidden levels, in the profile's unit, of one method and pattern of gaps.

    Example:
        >>> HiddenError("ridge", "top", rmse=3.0, n_flights=40, n_levels=900).rmse
        3.0
    """

    method: str
    pattern: str
    rmse: float
    n_flights: int
    n_levels: int


def hidden_errors(
    values: Tensor,
    mask: Tensor,
    pattern: Pattern,
    *,
    share: float = 0.3,
    explained_variance: float = 0.95,
    seed: int = 0,
    speed: Tensor | None = None,
) -> list[HiddenError]:
    """Hide levels, fit every method to what is left of all flights, and compare with what was hidden.

    Args:
        values: (n, L) profiles.
        mask: (n, L) observed.
        pattern: Which levels are hidden.
        share: How many, see :func:`hide`.
        explained_variance: Of the components that the iteration and ridge use; PPCA completes with its own latent
            dimension.
        seed: Of the hiding.
        speed: (n,) by which ``slow`` hides; the mean of each flight's values if absent.

    Raises:
        DataError: If there are too few flights to hide any level.

    Returns:
        An error per method, in the order of :data:`METHODS`.

    Example:
        >>> size, heights = torch.randn(40, 1).double(), torch.linspace(0, 1, 30).double()
        >>> values, mask = 280 + 10 * size * heights, torch.rand(40, 30) > 0.1
        >>> errors = {error.method: error.rmse for error in hidden_errors(values, mask, "random")}
        >>> errors["probabilistic PCA"] < errors["mean fill"]
        True
    """
    own = torch.where(mask, values, 0.0).sum(1) / mask.sum(1)
    hidden = hide(mask, pattern, share, own if speed is None else speed, torch.Generator().manual_seed(seed))
    if not bool(hidden.any()):
        raise DataError(
            f"{len(values)} flights of which no level can be hidden",
            expected="more than a tenth of them at some levels",
            mend="give more flights, or hide a larger share",
        )
    seen = mask & ~hidden
    errors = []
    for method in METHODS:
        error = torch.where(hidden, _COMPLETE[method](values, seen, explained_variance) - values, 0.0)
        rmse = float((error.square().sum() / hidden.sum()).sqrt())
        errors.append(HiddenError(method, pattern, rmse, len(values), int(hidden.sum())))
    return errors


def hide(mask: Tensor, pattern: Pattern, share: float, speed: Tensor, generator: torch.Generator) -> Tensor:
    """Levels (n, L) to hide of those observed.

    ``top`` hides from each flight's highest level down, a share drawn between zero and twice ``share``; ``random``
    hides single levels with probability ``share``; ``slow`` hides tops of the slower half of the flights alone, twice
    as much of each, as where slow operators cruise low: what is hidden then depends on what is shown.

    Args:
        mask: (n, L) observed.
        pattern: Which levels.
        share: How many.
        speed: (n,) by which flights are slow.
        generator: Of the draws.
    """
    if pattern == "random":
        return spared(mask, mask & (torch.rand(mask.shape, generator=generator) < share))
    part = 2 * share * torch.rand(len(mask), 1, generator=generator)
    if pattern == "slow":
        part = torch.where((speed < speed.median())[:, None], (2 * part).clamp(max=MOST_HIDDEN), 0.0)
    return spared(mask, highest(mask, part))


def _mean_fill(values: Tensor, seen: Tensor, explained_variance: float) -> Tensor:
    return observed_mean(torch.where(seen, values, 0.0), seen).expand_as(values)


def _iteration(values: Tensor, seen: Tensor, explained_variance: float) -> Tensor:
    basis = fit_components(values, seen, FL_M, explained_variance, "iterative")
    return basis.decode(basis.encode(values, seen))


def _ppca(values: Tensor, seen: Tensor, explained_variance: float) -> Tensor:
    return fit_components(values, seen, FL_M, explained_variance).complete(values, seen)


def _ridge(values: Tensor, seen: Tensor, explained_variance: float) -> Tensor:
    """Penalised least squares on the components of the iteration, the penalty chosen on levels hidden once more."""
    basis = fit_components(values, seen, FL_M, explained_variance, "iterative")
    inner = hide_tops(seen, 0.2, torch.Generator().manual_seed(1))

    def loss(ridge: float) -> float:
        error = torch.where(inner, _penalised(basis, values, seen & ~inner, ridge) - values, 0.0)
        return float(error.square().sum())

    return _penalised(basis, values, seen, min(RIDGES, key=loss))


def _penalised(basis: FunctionalBasis, values: Tensor, seen: Tensor, ridge: float) -> Tensor:
    modes = basis.components * FL_M**0.5
    spread = basis.explained_variance / basis.explained_variance.max()
    weighted = seen.to(values.dtype)
    gram = torch.einsum("nl,kl,jl->nkj", weighted, modes, modes) + torch.diag(ridge / spread)
    target = torch.where(seen, values - basis.mean, 0.0) @ modes.T
    weights: Tensor = torch.linalg.solve(gram, target)
    filled: Tensor = basis.mean + weights @ modes
    return filled


def complete(method: str, values: Tensor, mask: Tensor, explained_variance: float = 0.95) -> Tensor:
    """Whole profiles (n, L) that one of :data:`METHODS` makes of gappy ones.

    Args:
        method: One of :data:`METHODS`.
        values: (n, L) profiles.
        mask: (n, L) observed; masked values are ignored.
        explained_variance: Of the components of the iteration and ridge.

    Returns:
        (n, L) values without gaps.

    Example:
        >>> values, mask = torch.tensor([[280.0, 290.0], [300.0, 0.0]]), torch.tensor([[True, True], [True, False]])
        >>> complete("mean fill", values, mask)[1]
        tensor([290., 290.])
    """
    return _COMPLETE[method](values, mask, explained_variance)


_COMPLETE: dict[str, Callable[[Tensor, Tensor, float], Tensor]] = {
    "mean fill": _mean_fill,
    "iteration (paper)": _iteration,
    "ridge": _ridge,
    "probabilistic PCA": _ppca,
}
