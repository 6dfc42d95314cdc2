"""Components of gappy and of complete profiles against scikit-learn and closed forms."""

import numpy as np
import pytest
import torch
from sklearn.decomposition import PCA
from torch import Tensor
from toys import normal

from descentflow.core.errors import DataError
from descentflow.representation.fpca import ppca
from descentflow.representation.fpca._complete import leading, mean_and_covariance
from descentflow.representation.fpca.gappy import Method, fit_components
from descentflow.representation.fpca.mask_groups import MaskGroups, group_masks

SPACING_M = 30.48


def curves(n: int, n_levels: int = 40, noise: float = 0.1, seed: int = 0) -> torch.Tensor:
    """Smooth random curves of six decaying modes, with noise."""
    generator = torch.Generator().manual_seed(seed)
    h = torch.linspace(0, 1, n_levels, dtype=torch.float64)
    modes = torch.stack([torch.cos((k + 1) * 2.0 * h + k) for k in range(6)])
    scores = torch.randn(n, 6, generator=generator, dtype=torch.float64) / (1 + torch.arange(6)) ** 1.5
    return 10 + 3 * scores @ modes + noise * torch.randn(n, n_levels, generator=generator, dtype=torch.float64)


def top_gaps(n: int, n_levels: int, seed: int = 1) -> torch.Tensor:
    """Masks of flights that start at random levels in the upper half."""
    generator = torch.Generator().manual_seed(seed)
    top = torch.randint(n_levels // 2, n_levels + n_levels // 4, (n,), generator=generator).clamp(max=n_levels)
    return torch.arange(n_levels) < top[:, None]


def test_complete_data_equals_scikit_learn() -> None:
    values = curves(300)
    full = torch.ones_like(values, dtype=torch.bool)
    basis = fit_components(values, full, SPACING_M, 0.95)
    reference = PCA(n_components=0.95).fit(values.numpy())
    assert basis.n_components == reference.n_components_
    # Both are eigenvectors of one covariance: equal but for rounding and the sign.
    products = (basis.components * SPACING_M**0.5).numpy() @ reference.components_.T
    np.testing.assert_allclose(np.abs(np.diag(products)), 1, atol=1e-10)
    np.testing.assert_allclose(basis.explained_variance, reference.explained_variance_ratio_, rtol=1e-9)
    scores = basis.encode(values, full) / SPACING_M**0.5
    np.testing.assert_allclose(scores.abs(), np.abs(reference.transform(values.numpy())), atol=1e-9)


def test_em_likelihood_of_gappy_data_never_falls() -> None:
    values = curves(200)
    mask = top_gaps(*values.shape)
    centred = torch.where(mask, values - ppca.observed_mean(values, mask), 0.0)
    fitted = ppca.em(centred, mask, 8, max_iterations=60, tolerance=-1.0)
    assert np.diff(fitted.log_likelihood).min() > -1e-12


def test_gappy_likelihood_equals_direct_gaussian() -> None:
    """The Woodbury form against the multivariate normal of each flight's observed levels."""
    values = curves(30, n_levels=12)
    mask = top_gaps(30, 12)
    mean = ppca.observed_mean(values, mask)
    centred = torch.where(mask, values - mean, 0.0)
    start = ppca.closed_form(ppca.pairwise_covariance(centred, mask), 3)
    covariance = start[0] @ start[0].T + start[1] * torch.eye(12, dtype=torch.float64)
    direct = 0.0
    for row, seen in zip(centred, mask, strict=True):
        normal = torch.distributions.MultivariateNormal(
            torch.zeros(int(seen.sum())).double(), covariance[seen][:, seen]
        )
        direct += float(normal.log_prob(row[seen]))
    fitted = ppca.em(centred, mask, 3, max_iterations=1, tolerance=0.0)
    assert fitted.log_likelihood[0] == pytest.approx(direct / int(mask.sum()), rel=1e-9)


@pytest.mark.parametrize("method", ["ppca", "iterative"])
def test_components_are_orthonormal_over_altitude(method: Method) -> None:
    values = curves(200)
    basis = fit_components(values, top_gaps(*values.shape), SPACING_M, 0.9, method)
    gram = basis.components @ basis.components.T * SPACING_M
    torch.testing.assert_close(gram, torch.eye(basis.n_components, dtype=torch.float64), atol=1e-10, rtol=0)


def test_completion_is_the_conditional_expectation() -> None:
    """Missing levels given the observed ones, against the textbook formula, noise counted by its length."""
    values = curves(200, n_levels=20)
    mask = top_gaps(200, 20)
    basis = fit_components(values, mask, SPACING_M, 0.9)
    covariance = basis.loadings @ basis.loadings.T + basis.noise_variance * basis.noise_length * torch.eye(
        20, dtype=torch.float64
    )
    completed = basis.complete(values, mask)
    for i in range(20):
        seen = mask[i]
        gain = torch.linalg.solve(covariance[seen][:, seen], (values[i] - basis.mean)[seen])
        expected = basis.mean[~seen] + covariance[~seen][:, seen] @ gain
        torch.testing.assert_close(completed[i, ~seen], expected, rtol=1e-8, atol=1e-8)


def test_ppca_fills_hidden_levels_better_than_the_papers_iteration_and_the_mean() -> None:
    """On smooth curves the error on hidden levels falls in the order of numerics.md; margins far above seed noise."""
    truth = curves(600, noise=0.0)
    noisy = truth + 0.1 * torch.randn(truth.shape, generator=torch.Generator().manual_seed(5), dtype=torch.float64)
    mask = top_gaps(*truth.shape)
    spread = (truth - truth.mean(0))[~mask].norm()
    errors = {}
    for method in ("ppca", "iterative"):
        basis = fit_components(noisy, mask, SPACING_M, 0.95, method)
        errors[method] = float((basis.complete(noisy, mask) - truth)[~mask].norm() / spread)
    assert errors["ppca"] < 0.8 * errors["iterative"]
    assert errors["iterative"] < 1.0


def test_the_mean_is_that_of_all_flights_where_slow_ones_show_no_top() -> None:
    """Two levels, the upper seen where the lower is high: one component and noise are a full covariance, whose mean of
    greatest likelihood is Anderson's (1957), the regression on the lower level taken to all flights."""
    generator = torch.Generator().manual_seed(0)
    shared = torch.randn(800, 1, generator=generator, dtype=torch.float64)
    values = 100 + shared * torch.tensor([3.0, 5.0]) + torch.randn(800, 2, generator=generator, dtype=torch.float64)
    mask = torch.ones(800, 2, dtype=torch.bool)
    mask[:, 1] = values[:, 0] > 100
    lower, upper = values[mask[:, 1]].T
    slope = ((lower - lower.mean()) * (upper - upper.mean())).sum() / (lower - lower.mean()).square().sum()
    expected = upper.mean() + slope * (values[:, 0].mean() - lower.mean())
    observed = ppca.observed_mean(values, mask)
    centred = torch.where(mask, values - observed, 0.0)
    fitted = ppca.em(centred, mask, 1, max_iterations=5000, tolerance=1e-13)
    mean = observed + fitted.shift
    assert float(observed[1]) > 103, "those that show it are fast"
    torch.testing.assert_close(mean, torch.stack([values[:, 0].mean(), expected]), rtol=0, atol=1e-3)


@pytest.mark.parametrize("method", ["ppca", "iterative"])
def test_values_at_missing_levels_are_not_read(method: Method) -> None:
    values = curves(100)
    mask = top_gaps(*values.shape)
    poisoned = torch.where(mask, values, torch.nan)
    clean, dirty = (fit_components(v, mask, SPACING_M, 0.9, method) for v in (values, poisoned))
    torch.testing.assert_close(clean.encode(values, mask), dirty.encode(poisoned, mask))


@pytest.mark.parametrize(
    ("values", "mask", "words"),
    [
        (torch.ones(1, 3), torch.ones(1, 3, dtype=torch.bool), "1 training flight"),
        (torch.full((5, 3), torch.inf), torch.ones(5, 3, dtype=torch.bool), "not finite"),
        (torch.rand(5, 3), torch.tensor([[True, True, False]]).expand(5, 3), "fewer than two training flights"),
    ],
)
def test_useless_profiles_are_refused(values: torch.Tensor, mask: torch.Tensor, words: str) -> None:
    with pytest.raises(DataError, match=words):
        fit_components(values, mask, SPACING_M)


def test_profiles_that_are_all_alike_have_no_component_and_no_curve_beyond() -> None:
    values = torch.linspace(1.0, 3.0, 5).double().expand(8, 5)
    mask = torch.ones(8, 5, dtype=torch.bool)
    mask[:3, 4] = False
    basis = fit_components(values, mask, SPACING_M)
    weights = basis.encode(values, mask)
    assert weights.shape == (8, 0)
    torch.testing.assert_close(basis.decode(weights), values)
    assert float(basis.left_out().abs().max()) == 0.0


def test_no_loading_at_all_leaves_the_noise_alone() -> None:
    centred, mask = torch.tensor([[1.0, 2.0], [3.0, 0.0]]).double(), torch.tensor([[True, True], [True, False]])
    likelihood = ppca.log_likelihood(centred, mask, torch.zeros(2, 0).double(), torch.tensor(4.0).double())
    expected = torch.distributions.Normal(0.0, 2.0).log_prob(centred)[mask].sum()
    torch.testing.assert_close(likelihood, expected.to(likelihood))


def complete_curves(n: int, n_levels: int = 30, noise: float = 0.3) -> Tensor:
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
    values = complete_curves(300)
    mean, covariance = mean_and_covariance(values)
    model = ppca.PPCA(*leading(covariance, 3), torch.zeros(30).double(), [], converged=True)
    centred = (values - mean) * (300 / 299) ** 0.5
    whole = torch.ones_like(centred, dtype=torch.bool)
    iterated = ppca.em(centred, whole, 3, max_iterations=5000, tolerance=1e-14)
    assert len(iterated.log_likelihood) > 2
    torch.testing.assert_close(covariance_of(model), covariance_of(iterated), rtol=0, atol=1e-5)


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
