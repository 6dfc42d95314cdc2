"""Probabilistic PCA of profiles of which nothing is missing: one product and the leading eigenvectors of it."""

from functools import partial

import numpy as np
import torch
from torch import Tensor

from descentflow.representation.fpca.ppca import LEAST_NOISE, PPCA
from descentflow.representation.fpca.roughness import TUNING_FLIGHTS, Centred

LEAST_SPREAD = 1e-4
"""Share of the mean square at a level that is variance: below it, taking the mean off the products costs digits."""


def complete_profiles(values: Tensor) -> Centred:
    """Profiles of which nothing is missing: all that components need of them is their mean and covariance.

    Args:
        values: (n, L) float64.

    Example:
        >>> curves = torch.randn(100, 1).double() + 0.1 * torch.randn(100, 20).double()
        >>> round(float(complete_profiles(curves).model(1).noise_variance), 2)
        0.01
    """
    mean, covariance = mean_and_covariance(values)
    variances = covariance.diagonal()
    scale = variances.mean().sqrt()
    # Not finite where any value is not, which saves a search of all; the mean squares of the levels together.
    largest = (variances + mean.square()).sum().sqrt()
    covariance.div_(scale.square().clamp(min=1e-300))
    some = (values[:TUNING_FLIGHTS] - mean) / scale
    return Centred(
        mean, scale, largest, some, torch.ones_like(some, dtype=torch.bool), partial(_model, covariance), _fit
    )


def _fit(some: Tensor, _: Tensor, q: int) -> PPCA:
    # About the mean of all, as the parts of gappy profiles are.
    return _model(own_product(some) / max(len(some) - 1, 1), q)


def _model(covariance: Tensor, q: int) -> PPCA:
    return PPCA(*leading(covariance, q), covariance.new_zeros(len(covariance)), [], converged=True)


def mean_and_covariance(values: Tensor) -> tuple[Tensor, Tensor]:
    """Mean (L,) and covariance (L, L) of complete profiles (n, L), float64.

    Example:
        >>> mean_and_covariance(torch.tensor([[4.0, 7.0], [2.0, 3.0]]).double())
        (tensor([3., 5.], dtype=torch.float64), tensor([[2., 4.],
                [4., 8.]], dtype=torch.float64))
    """
    n = len(values)
    mean, products = values.mean(0), own_product(values)
    second = products.diagonal() / n
    if bool((second - mean.square() > LEAST_SPREAD * second).all()):
        products = products.addr_(mean, mean, alpha=-n)
    else:
        products = own_product(values - mean)
    return mean, products.div_(max(n - 1, 1))


def own_product(values: Tensor) -> Tensor:
    """``values' values`` (L, L) of values (n, L).

    NumPy sees that both factors are the same and computes one triangle, at half of torch's time.

    Example:
        >>> own_product(torch.tensor([[1.0, 2.0], [3.0, 4.0]]))
        tensor([[10., 14.],
                [14., 20.]])
    """
    rows = values.cpu().numpy()
    return torch.from_numpy(rows.T @ rows).to(values.device)


def leading(covariance: Tensor, q: int) -> tuple[Tensor, Tensor]:
    """Maximum-likelihood loadings (L, q) and noise variance () of a covariance (Tipping and Bishop, section 3.2).

    As :func:`~descentflow.representation.fpca.ppca.closed_form`, from the leading eigenvectors alone: what the others
    have together is the rest of the trace. A covariance of pairs of levels, whose eigenvalues may be negative, is not
    one of these.

    Args:
        covariance: (L, L), positive semidefinite.
        q: Latent dimension.

    Example:
        >>> loadings, noise = leading(torch.diag(torch.tensor([9.0, 1.0, 1.0]).double()), q=1)
        >>> round(float(loadings.norm() ** 2), 4), float(noise)  # 9 = 8 + 1
        (8.0, 1.0)
    """
    n_levels = len(covariance)
    # NumPy's, as the product: SciPy has threads of its own, which would wait for cores that NumPy's still hold.
    values, vectors = np.linalg.eigh(covariance.cpu().numpy())
    eigenvalues = torch.from_numpy(values[n_levels - q :]).flip(0).to(covariance)
    eigenvectors = torch.from_numpy(vectors[:, n_levels - q :]).flip(1).to(covariance)
    floor = eigenvalues[0].clamp(min=1e-300) * LEAST_NOISE
    rest = (covariance.trace() - eigenvalues.sum()) / max(n_levels - q, 1) if q < n_levels else floor
    noise = torch.maximum(rest, floor)
    return eigenvectors * (eigenvalues - noise).clamp(min=0).sqrt(), noise
