"""Components of complete profiles in closed form."""

import numpy as np
import pytest
import torch
from torch import Tensor
from toys import normal

from descentflow.representation.fpca import ppca
from descentflow.representation.fpca._complete import leading, mean_and_covariance
from descentflow.representation.fpca._mask_groups import MaskGroups, group_masks


def curves(n: int, n_levels: int = 30, noise: float = 0.3) -> Tensor:
    """Three smooth modes and noise."""
    place = torch.linspace(0, 1, n_levels, dtype=torch.float64)
    modes = torch.stack([torch.cos(torch.pi * k * place) / k for k in range(1, 4)])
    return 100 + normal(n, 3) @ modes + noise * normal(n, n_levels, seed=1)


def covariance_of(fitted: ppca.PPCA) -> Tensor:
    eye = torch.eye(len(fitted.loadings), dtype=torch.float64)
    return fitted.loadings @ fitted.loadings.T + fitted.noise_variance * eye


def test_the_closed_form_is_where_em_ends() -> None:
    """EM divides by n and starts off its maximum. It stops at gains below 1e-14 nats a value, to whose root, 1e-7, the
    parameters are then found; of slow EM some hundred times that are left."""
    values = curves(300)
    mean, covariance = mean_and_covariance(values)
    found = ppca.PPCA(*leading(covariance, 3), torch.zeros(30).double(), [], converged=True)
    centred = (values - mean) * (300 / 299) ** 0.5
    whole = torch.ones_like(centred, dtype=torch.bool)
    iterated = ppca.em(centred, whole, 3, max_iterations=5000, tolerance=1e-14)
    assert len(iterated.log_likelihood) > 2
    torch.testing.assert_close(covariance_of(found), covariance_of(iterated), rtol=0, atol=1e-5)


@pytest.mark.parametrize("offset", [0.0, 1e3, 1e7])
def test_mean_and_covariance_keep_their_digits_far_from_zero(offset: float) -> None:
    """The offset is a power of ten that float64 adds to hundredths with 1e-9 of error left."""
    values = normal(500, 12) + offset
    mean, covariance = mean_and_covariance(values)
    np.testing.assert_allclose(mean, values.numpy().mean(0), rtol=1e-14, atol=1e-14)
    np.testing.assert_allclose(covariance, np.cov(values.numpy().T), rtol=0, atol=1e-9)


def few_and_many_masks() -> list[Tensor]:
    tops = torch.randint(1, 6, (200, 1), generator=torch.Generator().manual_seed(0))
    return [torch.arange(6) < tops, torch.rand(200, 30, generator=torch.Generator().manual_seed(1)) < 0.5]


@pytest.mark.parametrize("mask", few_and_many_masks())
def test_masks_one_by_one_and_all_at_once_give_what_flights_one_by_one_do(mask: Tensor) -> None:
    groups: MaskGroups = group_masks(mask)
    rows, matrices = normal(200, 4), normal(len(groups.masks), 4, 3, seed=2)
    expected = torch.stack([row @ matrices[g] for row, g in zip(rows, groups.group, strict=True)])
    torch.testing.assert_close(groups.times(rows, matrices), expected)
    outer = torch.zeros(len(groups.masks), 4, 4, dtype=torch.float64)
    for row, g in zip(rows, groups.group, strict=True):
        outer[g] += row[:, None] * row
    torch.testing.assert_close(groups.moments(rows), outer)
    assert groups.counts.tolist() == [int((groups.group == u).sum()) for u in range(len(groups.masks))]
