"""Components of complete profiles in closed form, against EM, NumPy and results flight by flight."""

import numpy as np
import pytest
import torch
from torch import Tensor

from descentflow.representation.fpca import ppca
from descentflow.representation.fpca.complete import leading, mean_and_covariance
from descentflow.representation.fpca.gappy import fit_components
from descentflow.representation.fpca.mask_groups import MaskGroups, group_masks
from descentflow.representation.fpca.roughness import LENGTHS, hide_tops, missed


def normal(*shape: int, seed: int = 0) -> Tensor:
    return torch.randn(*shape, generator=torch.Generator().manual_seed(seed), dtype=torch.float64)


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


@pytest.mark.parametrize(
    "covariance",
    [
        torch.cov(curves(200).T),
        torch.cov(curves(8).T),  # fewer flights than levels
        torch.eye(30).double(),  # no direction before another
        torch.cov(curves(200, noise=0.0).T),  # no noise
    ],
)
@pytest.mark.parametrize("q", [1, 3, 7, 30])
def test_leading_eigenvectors_say_what_all_of_them_do(covariance: Tensor, q: int) -> None:
    loadings, noise = leading(covariance, q)
    expected, rest = ppca.closed_form(covariance, q)
    # Of no noise a share of 1e-10 is kept, beside which rounding (1e-16 of the trace) counts for 1e-6.
    torch.testing.assert_close(noise, rest, rtol=1e-5, atol=0)
    # With eigenvalues alike, any directions are as good: what they explain is compared.
    torch.testing.assert_close(
        torch.linalg.svdvals(loadings).square(), torch.linalg.svdvals(expected).square(), rtol=0, atol=1e-10
    )
    if float(covariance[0, 1]):
        torch.testing.assert_close(loadings @ loadings.T, expected @ expected.T, rtol=0, atol=1e-9)


def test_components_of_complete_profiles_do_not_depend_on_what_is_learnt_of_others() -> None:
    values = curves(300)
    whole = torch.ones_like(values, dtype=torch.bool)
    learnt = fit_components(values, whole, 30.48, 0.9)
    plain = fit_components(values, whole, 30.48, 0.9, learn_constants=False)
    assert torch.equal(learnt.components, plain.components)
    assert torch.equal(learnt.loadings, plain.loadings)
    assert float(plain.noise_length) == 1.0


def test_without_learning_gappy_levels_are_taken_as_they_are() -> None:
    values = curves(24)
    mask = torch.arange(30) < torch.randint(10, 40, (24, 1), generator=torch.Generator().manual_seed(3))
    mask[:3] = True
    plain = fit_components(values, mask, 30.48, 0.9, learn_constants=False)
    smooth = fit_components(values, mask, 30.48, 0.9)
    assert float(plain.mean.diff().diff().norm()) > 2 * float(smooth.mean.diff().diff().norm())


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


@pytest.mark.parametrize("mask", few_and_many_masks())
def test_noise_given_loadings_is_what_residuals_level_by_level_give(mask: Tensor) -> None:
    """Ten EM steps, each from the residuals of every flight and the spread of its posterior."""
    n_levels = mask.shape[1]
    shown, loadings = torch.where(mask, normal(200, n_levels), 0.0), normal(n_levels, 2, seed=4)
    noise = torch.tensor(5.0).double()
    for _ in range(ppca.NOISE_STEPS):
        total = torch.zeros(()).double()
        for row, seen in zip(shown, mask, strict=True):
            own = loadings[seen]
            covariance = noise * torch.linalg.inv(own.T @ own + noise * torch.eye(2).double())
            z = covariance @ own.T @ row[seen] / noise
            total += (row[seen] - own @ z).square().sum() + (own @ covariance @ own.T).trace()
        noise = total / mask.sum()
    found = ppca.noise_given_loadings(shown, mask, loadings, torch.tensor(5.0).double())
    torch.testing.assert_close(found, noise, rtol=1e-10, atol=0)


def test_curves_without_noise_keep_a_share_of_their_own() -> None:
    """EM would halve the noise at every step, until rounding makes it negative."""
    loadings = normal(10, 2)
    mask = torch.arange(10) < torch.randint(5, 11, (50, 1), generator=torch.Generator().manual_seed(0))
    shown = torch.where(mask, normal(50, 2, seed=1) @ loadings.T, 0.0)
    found = ppca.noise_given_loadings(shown, mask, loadings, torch.tensor(1e-9).double())
    assert float(found) == pytest.approx(float(ppca.LEAST_NOISE * shown.square().sum() / mask.sum()))


def test_errors_of_all_lengths_are_those_of_one_after_the_other() -> None:
    values, loadings, noise = curves(60) - 100, normal(30, 3), torch.tensor(0.2).double()
    mask = torch.ones_like(values, dtype=torch.bool)
    hidden = hide_tops(mask, 0.3, torch.Generator().manual_seed(0))
    found = missed(values, mask & ~hidden, hidden, loadings, noise)
    for length, error in zip(LENGTHS, found, strict=True):
        expected = 0.0
        for row, gap in zip(values, hidden, strict=True):
            own = loadings[~gap]
            z = torch.linalg.solve(own.T @ own + length * noise * torch.eye(3).double(), own.T @ row[~gap])
            expected += float((loadings[gap] @ z - row[gap]).square().sum())
        assert error == pytest.approx(expected, rel=1e-9)
