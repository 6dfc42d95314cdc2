"""Profiles as linear functions of weights and residual components: what observed levels say of both."""

from dataclasses import dataclass

import torch
from torch import Tensor

from descentflow.core.errors import ConfigError
from descentflow.representation.decoder.descent_decoder import DescentDecoder
from descentflow.representation.drag_scale import Observed
from descentflow.representation.evidence import Gaps, WeightEvidence
from descentflow.representation.fpca.mask_groups import group_masks
from descentflow.representation.profiles import Profiles

KEPT_NOISE = 1e-4
"""Share of the noise that blurs the weights of a flight seen whole: enough for the arithmetic, 1 % of its deviation."""
BLOCK = 512
"""Sets of observed levels whose information is computed at a time."""
FLIGHTS = 4096
"""Flights whose values are weighted at a time."""


@dataclass(frozen=True)
class Information:
    """Log-likelihood of u for n flights, ``shift' u - u' precision u / 2`` up to a constant.

    Shapes: ``precisions`` (U, D, D), one for each set of observed levels; ``shift`` (n, D); ``group`` (n,).

    Example:
        >>> two = Information(torch.eye(2)[None], torch.ones(1, 2), torch.tensor([0]))
        >>> precisions, shift = two.marginal(n_weights=1)  # the second is standard normal and says nothing of the first
        >>> precisions, shift
        (tensor([[[1.]]]), tensor([[1.]]))
    """

    precisions: Tensor
    shift: Tensor
    group: Tensor

    def to(self, device: torch.device | str) -> "Information":
        """The same on another device."""
        return Information(self.precisions.to(device), self.shift.to(device), self.group.to(device))

    def marginal(self, n_weights: int) -> tuple[Tensor, Tensor]:
        """Precisions (U, d, d) and shift (n, d) of the first d of u, the others integrated over a standard normal."""
        d = n_weights
        inner = self.precisions[:, d:, d:]
        across = self.precisions[:, d:, :d]
        factor = torch.linalg.cholesky(inner + torch.eye(inner.shape[1]).to(inner))
        gain = torch.cholesky_solve(across, factor)  # (U, r, d)
        precisions = self.precisions[:, :d, :d] - across.mT @ gain
        passed = [
            (rest[:, None] @ gain[g])[:, 0]
            for rest, g in zip(torch.split(self.shift[:, d:], BLOCK), torch.split(self.group, BLOCK), strict=True)
        ]
        return precisions, self.shift[:, :d] - torch.cat(passed)


@dataclass(frozen=True)
class LinearCurves:
    r"""``profiles = offset + loadings u + noise`` with ``u = (w, r)``: weights, then residual components.

    The profiles are drag on its scale and CAS, see :class:`~descentflow.representation.drag_scale.Observed`.

    The d weights w are those of the density. The residual components r, standard normal a priori and independent of
    w, are the directions of the probabilistic PCA that the explained-variance cut left out of the weights: without them
    a flight would be thought to follow the kept components to within white noise, and its future known too well.

    The weights of a flight are what :meth:`~descentflow.representation.decoder.descent_decoder.DescentDecoder.encode`
    gives of the *whole* profile. What noise adds to that projection is therefore part of the weights, and not of the
    noise about them: with $N$ the variance of the noise and $\Phi$ the kept loadings on all levels, the noise that is
    left has the covariance $N - (1 - \epsilon)\,\Phi (\Phi^T N^{-1} \Phi)^{-1} \Phi^T$. A flight that shows every level
    then has the weights that it is encoded to, to within a small $\epsilon$.

    Shapes: ``offset`` and ``noise_variance`` (2 L,), ``loadings`` (2 L, d + r), profile after profile.

    Example:
        >>> from descentflow.densities.checkpoint import load_model
        >>> curves = linear_curves(load_model("best.ckpt").representation.decoder)
        >>> at_mean = torch.zeros(1, curves.loadings.shape[1], dtype=torch.float64)
        >>> mean = curves.scaled_profiles(at_mean)
        >>> seen = torch.ones_like(mean[0], dtype=torch.bool)
        >>> information = curves.information(Observed(mean, seen))
        >>> bool((information.shift.abs() < 1e-3).all())  # an observed mean profile does not move the weights
        True
    """

    offset: Tensor
    loadings: Tensor
    noise_variance: Tensor
    n_weights: int

    @property
    def n_residual(self) -> int:
        """Number of residual components."""
        return self.loadings.shape[1] - self.n_weights

    def information(self, observed: Observed) -> Information:
        """Evidence of observed levels on u.

        Args:
            observed: Of n flights; masked values are ignored.
        """
        d, total = self.n_weights, self.loadings.shape[1]
        scaled = self.loadings / self.noise_variance[:, None]
        products = torch.einsum("lu,lv->luv", scaled, self.loadings).flatten(1)
        # Observed on the same levels, so the products of both profiles are added up level by level.
        groups, mask = group_masks(observed.mask), observed.mask.repeat(1, 2)
        by_level = torch.stack(products.chunk(2)).sum(0)
        white = torch.cat([masks @ by_level for masks in torch.split(groups.masks, BLOCK)]).reshape(-1, total, total)
        some = zip(*(torch.split(one, FLIGHTS) for one in (mask, *observed.values)), strict=True)
        shift = torch.cat(
            [
                torch.where(seen, torch.cat(values, 1).to(self.offset) - self.offset, 0.0) @ scaled
                for seen, *values in some
            ]
        )
        # The noise left is that of the class's docstring: its inverse by Woodbury.
        whole = by_level.sum(0).reshape(total, total)[:d, :d]
        gap = torch.linalg.cholesky(whole / (1 - KEPT_NOISE) - white[:, :d, :d])
        gain = torch.cholesky_solve(white[:, :d], gap)  # (U, d, D)
        moved = [
            (part[:, None, :d] @ gain[g])[:, 0]
            for part, g in zip(torch.split(shift, BLOCK), torch.split(groups.group, BLOCK), strict=True)
        ]
        precisions = white + white[:, :d].mT @ gain
        return Information((precisions + precisions.mT) / 2, shift + torch.cat(moved), groups.group)

    def scaled_profiles(self, u: Tensor) -> tuple[Tensor, ...]:
        """Drag on its scale and CAS, each (n, L), of u (n, D)."""
        return (self.offset + u @ self.loadings.T).chunk(2, dim=1)


def linear_curves(decoder: DescentDecoder) -> LinearCurves:
    """The linear form of a decoder's bases and scaler.

    Raises:
        ConfigError: If the bases were fitted by the paper's iteration, which has no model of what they leave out.

    Example:
        >>> from descentflow.densities.checkpoint import load_model
        >>> curves = linear_curves(load_model("best.ckpt").representation.decoder)
        >>> curves.loadings.shape[1] == curves.n_weights + curves.n_residual
        True
    """
    if not has_noise_model(decoder):
        raise ConfigError(
            "components fitted by the paper's iteration (data.fpca: iterative)",
            expected="probabilistic PCA, which gives the spread about the components",
            mend="fit again with data.fpca: ppca",
        )
    bases = list(decoder.bases.values())
    sizes = [basis.n_components for basis in bases]
    means, scales = (torch.split(values, sizes) for values in (decoder.weight_mean, decoder.weight_scale))
    kept = [basis.components.T for basis in bases]
    offsets = [basis.mean + k @ mean for basis, k, mean in zip(bases, kept, means, strict=True)]
    kept = [k * scale for k, scale in zip(kept, scales, strict=True)]
    # Levels whose noise is alike tell together as much as one: the same as each with so many times the variance.
    noise = [(basis.noise_variance * basis.noise_length).expand(len(basis.mean)) for basis in bases]
    rest = [basis.left_out() for basis in bases]
    loadings = torch.cat([torch.block_diag(*kept), torch.block_diag(*rest)], 1)  # type: ignore[no-untyped-call]
    return LinearCurves(torch.cat(offsets), loadings, torch.cat(noise), decoder.dimension)


def has_noise_model(decoder: DescentDecoder) -> bool:
    """True where the components come with a model of their residual; those of the paper's iteration do not.

    Example:
        >>> from descentflow.densities.checkpoint import load_model
        >>> has_noise_model(load_model("best.ckpt").representation.decoder)
        True
    """
    return all(basis.loadings.shape[1] > 0 for basis in decoder.bases.values())


def evidence_of(decoder: DescentDecoder, flights: Profiles, gaps: Gaps = "marginal") -> WeightEvidence:
    """Evidence of flights on their weights.

    Args:
        decoder: Whose components the weights are of.
        flights: On its grid.
        gaps: ``marginal`` leaves open what a flight does not show; ``filled`` puts its expectation there and takes the
            weights as known, as the paper does. With the components of the paper's iteration, which have no model of
            what they leave out, the weights are always known.

    Example:
        >>> from descentflow.representation.encode_flights import encode_flights
        >>> from descentflow.densities.checkpoint import load_model
        >>> import polars as pl
        >>> known = load_model("best.ckpt").representation
        >>> flights = encode_flights(pl.read_parquet("descents.parquet"), known)["test"].profiles
        >>> evidence = evidence_of(known.decoder, flights)
        >>> whole = flights.mask.all(1)  # a flight that shows every level is where it is encoded to
        >>> bool((evidence.points - known.decoder.encode(flights))[whole].abs().max() < 0.01)
        True
    """
    if gaps == "filled" or not has_noise_model(decoder):
        return WeightEvidence.of_weights(decoder.encode(flights))
    curves = linear_curves(decoder)
    seen = curves.information(decoder.drag_scale.observed(flights))
    return WeightEvidence.of_information(*seen.marginal(curves.n_weights), seen.group)
