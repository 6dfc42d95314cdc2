"""Whether there is a gap at all: how well effects explain it when labels are permuted, whole aircraft at a time."""

import torch
from torch import Tensor

from descentflow.diagnosis.findings.findings import NullTest
from descentflow.diagnosis.inference.likelihood import EffectsLikelihood

PERMUTATIONS = 299
"""The p-value is at least one in 300, a sixth of the least that would be called a gap."""


def permuted_labels(likelihood: EffectsLikelihood, count: int, seed: int) -> Tensor:
    """Labels (1 + count, n): the true ones first, then permuted by aircraft; signs where there is one side only.

    Example:
        >>> from descentflow.diagnosis.inference.example_sides import example_likelihood
        >>> from descentflow.effects import EFFECTS
        >>> likelihood = example_likelihood(EFFECTS["temperature"], [10.0])
        >>> labels = permuted_labels(likelihood, 9, seed=0)
        >>> labels.shape, bool((labels.sum(1) == 80).all())
        (torch.Size([10, 160]), True)
    """
    airframe, real = likelihood.compared.airframe, likelihood.real
    names, index = torch.unique(airframe, return_inverse=True)
    generator = torch.Generator().manual_seed(seed)
    if not likelihood.has_reference:
        signs = torch.randint(0, 2, (count, len(names)), generator=generator).double() * 2 - 1
        return torch.cat([torch.ones(1, len(real)), signs[:, index]]).double()
    owner = torch.zeros(len(names), dtype=torch.float64)
    owner[index] = real.double()
    dealt = [owner[torch.randperm(len(names), generator=generator)] for _ in range(count)]
    return torch.stack([owner, *dealt])[:, index]


def null_test(likelihood: EffectsLikelihood, discrepancy: Tensor, seed: int, count: int = PERMUTATIONS) -> NullTest:
    """Compare the best sensitivity and a free discrepancy with what permuted flights give.

    Args:
        likelihood: With a covariance that does not know the sides, or the test would favour the true ones.
        discrepancy: (n, p, e) columns of a shift of any shape, with unit prior spread.
        seed: Of the permutations.
        count: Number of permutations; the p-value is at least ``1 / (1 + count)``.

    Example:
        >>> from descentflow.diagnosis.inference.example_sides import example_likelihood
        >>> from descentflow.effects import EFFECTS
        >>> likelihood = example_likelihood(EFFECTS["temperature"], [10.0])
        >>> from descentflow.diagnosis.inference.discrepancy import discrepancy_columns
        >>> columns, _ = discrepancy_columns(likelihood.compared)
        >>> null_test(likelihood, columns, seed=0, count=19).p_value
        0.05
    """
    columns, own = _sensitivities(likelihood)
    every = torch.cat([columns, discrepancy], 2)
    information, gradient = _profiled(likelihood, every, permuted_labels(likelihood, count, seed))
    best = torch.full((count + 1,), -torch.inf, dtype=torch.float64)
    for part in own:
        size = len(part)
        at = torch.tensor(part)
        gain = _gain(information[:, at[:, None], at], gradient[:, at], 1e-6 * torch.ones(size, dtype=torch.float64))
        best = torch.maximum(best, (2 * gain - size) / (2 * size) ** 0.5)
    rest = torch.arange(columns.shape[2], every.shape[2])
    free = _gain(information[:, rest[:, None], rest], gradient[:, rest], torch.ones(len(rest), dtype=torch.float64))
    # Square roots bring both to a scale on which they can be set beside each other; all labellings are treated alike.
    standing = [_standing(value.sign() * value.abs().sqrt()) for value in (best, free)]
    largest = torch.maximum(*standing)
    p_value = float((largest >= largest[0] - 1e-12).double().mean())
    return NullTest(p_value, float(standing[0][0]), float(standing[1][0]), count)


def _standing(values: Tensor) -> Tensor:
    """Deviation from the null's mean in null spreads, where the null is all but the true labelling."""
    return (values - values[1:].mean()) / values[1:].std().clamp(min=1e-12)


def _sensitivities(likelihood: EffectsLikelihood) -> tuple[Tensor, list[list[int]]]:
    """Columns of the effects that are not windowed, and which of them belong to each effect."""
    columns, own, count = [torch.zeros(*likelihood.y.shape, 0, dtype=likelihood.y.dtype)], [], 0
    for name in likelihood.catalogue:
        if likelihood.windowed(name) is not None:
            continue
        jacobian = likelihood.jacobian(name, likelihood.start_of(name))
        kept = jacobian[:, :, jacobian.abs().amax((0, 1)) > 1e-12]
        if kept.shape[2]:
            columns.append(kept)
            own.append(list(range(count, count + kept.shape[2])))
            count += kept.shape[2]
    return torch.cat(columns, 2), own


def _profiled(likelihood: EffectsLikelihood, columns: Tensor, labels: Tensor) -> tuple[Tensor, Tensor]:
    """Information (b, e, e) and gradient (b, e) of columns under every labelling, all common columns profiled out."""
    n, _, e = columns.shape
    free = likelihood.compared.free
    products = likelihood.whitening.apply(columns)
    gradient = torch.einsum("npe,np->ne", columns, likelihood.qy)
    inner = torch.einsum("npe,npf->nef", columns, products).reshape(n, e * e)
    if not likelihood.has_reference:
        fixed = inner.sum(0).reshape(1, e, e).expand(len(labels), e, e)
        return fixed, labels @ gradient
    common = likelihood.common
    cross = torch.cat([products[:, free], torch.einsum("npq,npe->nqe", common.columns, products)], 1)
    size = cross.shape[1]
    total_cross = (labels @ cross.reshape(n, size * e)).reshape(-1, size, e)
    whole, known = _common_block(likelihood)
    lower = torch.linalg.cholesky(whole)
    half = torch.linalg.solve_triangular(lower, total_cross, upper=False)
    own = torch.linalg.solve_triangular(lower, known[:, None], upper=False)[:, 0]
    information = (labels @ inner).reshape(-1, e, e) - half.transpose(1, 2) @ half
    return information, labels @ gradient - torch.einsum("bse,s->be", half, own)


def _common_block(likelihood: EffectsLikelihood) -> tuple[Tensor, Tensor]:
    """Precision of mean and common columns together, and their gradient: the same under every labelling."""
    free, common = likelihood.compared.free, likelihood.common
    everyone = torch.ones(len(likelihood.y), dtype=torch.bool)
    mean = likelihood.whitening.total(everyone)[free][:, free]
    cross = common.products.sum(0)[free]
    inner = common.columns.flatten(0, 1).T @ common.products.flatten(0, 1) + torch.diag(common.ridge)
    whole = torch.cat([torch.cat([mean, cross], 1), torch.cat([cross.T, inner], 1)], 0)
    whole = whole + torch.diag(1e-9 * whole.diagonal())
    gradient = torch.cat([likelihood.qy.sum(0)[free], likelihood.qy.flatten() @ common.columns.flatten(0, 1)])
    return whole, gradient


def _gain(information: Tensor, gradient: Tensor, ridge: Tensor) -> Tensor:
    """Gain (b,) in log-likelihood of the best coefficients."""
    diagonal = information.diagonal(dim1=1, dim2=2)
    known = (diagonal > 1e-6).double()
    size = diagonal.clamp(min=1e-6).sqrt()
    scaled = information / (size[:, :, None] * size[:, None]) * known[:, :, None] * known[:, None]
    scaled = scaled + torch.diag_embed(ridge / size**2 * known + (1 - known) + 1e-9)
    vector = gradient / size * known
    gain: Tensor = 0.5 * (vector * torch.linalg.solve(scaled, vector[..., None])[..., 0]).sum(1)
    return gain
