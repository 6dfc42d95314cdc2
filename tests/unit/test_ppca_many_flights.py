"""Probabilistic PCA of many flights: masks that are sorted as bytes, and a start from some of the flights."""

import pytest
import torch
from torch import Tensor

from descentflow.representation.fpca import ppca
from descentflow.representation.fpca.mask_groups import group_masks


def gappy_curves(n: int, n_levels: int, q: int) -> tuple[Tensor, Tensor]:
    """Curves of smooth components whose tops are missing, zero there."""
    generator = torch.Generator().manual_seed(0)
    place = torch.linspace(0, 1, n_levels, dtype=torch.float64)
    modes = torch.stack([torch.cos(torch.pi * k * place) / k for k in range(1, q + 1)])
    curves = torch.randn(n, q, generator=generator, dtype=torch.float64) @ modes
    curves += 0.05 * torch.randn(n, n_levels, generator=generator, dtype=torch.float64)
    seen = torch.arange(n_levels) <= torch.randint(n_levels // 2, n_levels, (n, 1), generator=generator)
    return torch.where(seen, curves, 0.0), seen


@pytest.mark.parametrize("n_levels", [1, 8, 13, 64])
def test_masks_are_grouped_as_torch_sorts_them(n_levels: int) -> None:
    generator = torch.Generator().manual_seed(n_levels)
    mask = torch.rand(200, n_levels, generator=generator) < 0.5
    masks, group = torch.unique(mask, dim=0, return_inverse=True)
    found = group_masks(mask)
    assert torch.equal(found.masks, masks.double())
    assert torch.equal(found.group, group)


def test_some_of_many_flights_say_where_to_start(monkeypatch: pytest.MonkeyPatch) -> None:
    centred, mask = gappy_curves(900, 40, 4)
    plain = ppca.em(centred, mask, 4, max_iterations=100, tolerance=1e-5)
    monkeypatch.setattr(ppca, "FIRST_FLIGHTS", 200)
    started = ppca.em(centred, mask, 4, max_iterations=100, tolerance=1e-5)
    # Of what one component less would cost, some 0.1, a hundredth.
    assert started.log_likelihood[-1] == pytest.approx(plain.log_likelihood[-1], abs=1e-3)
    assert started.log_likelihood[0] > plain.log_likelihood[0]
    assert len(started.log_likelihood) < len(plain.log_likelihood)


@pytest.mark.parametrize(("most", "of_all"), [(30, 10), (12, 10)])
def test_iterations_of_some_flights_count_for_all(monkeypatch: pytest.MonkeyPatch, most: int, of_all: int) -> None:
    """If some of the flights take all iterations that are allowed, all flights take ten."""
    centred, mask = gappy_curves(900, 40, 4)
    plain = ppca.em(centred, mask, 4, max_iterations=most, tolerance=-1.0)
    assert len(plain.log_likelihood) == most
    monkeypatch.setattr(ppca, "FIRST_FLIGHTS", 200)
    started = ppca.em(centred, mask, 4, max_iterations=most, tolerance=-1.0)
    assert len(started.log_likelihood) == of_all
    assert started.log_likelihood[0] > plain.log_likelihood[0]


def test_levels_that_too_few_of_the_first_show_are_left_to_all(monkeypatch: pytest.MonkeyPatch) -> None:
    centred, mask = gappy_curves(900, 40, 4)
    mask[::2, -1] = False
    centred[::2, -1] = 0.0
    monkeypatch.setattr(ppca, "FIRST_FLIGHTS", 450)  # every second flight: none of them shows the last level
    found = ppca.em(centred, mask, 3, max_iterations=300, tolerance=1e-6)
    assert found.converged
    assert bool(found.loadings.isfinite().all())


def test_a_level_that_no_flight_shows_has_no_loadings_and_changes_no_other() -> None:
    """Of fifteen real flights a level was shown by one alone; dealt into three parts, one part did not have it."""
    generator = torch.Generator().manual_seed(5)
    values = torch.randn(12, 2, generator=generator).double() @ torch.randn(2, 20, generator=generator).double()
    values += 0.1 * torch.randn(12, 20, generator=generator).double()
    mask = torch.rand(12, 20, generator=generator) < 0.8
    mask[:, 7] = False
    centred = torch.where(mask, values, 0.0)
    others = torch.arange(20) != 7
    found = ppca.em(centred, mask, 2, max_iterations=3000, tolerance=1e-13)
    without = ppca.em(centred[:, others], mask[:, others], 2, max_iterations=3000, tolerance=1e-13)
    assert torch.equal(found.loadings[7], torch.zeros(2, dtype=torch.float64))
    product, same = found.loadings[others], without.loadings
    torch.testing.assert_close(product @ product.T, same @ same.T, rtol=1e-3, atol=1e-3)
    torch.testing.assert_close(found.noise_variance, without.noise_variance, rtol=1e-3, atol=0)
