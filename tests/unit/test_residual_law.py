"""Residual of a flight given its weights: closed forms, recovery of a known law, and samples."""

import math
from itertools import pairwise
from pathlib import Path

import pytest
import torch
import toys
from scipy.stats import binomtest, kstest, multivariate_normal
from torch import Tensor

from descentflow.densities import learn_residual_law as learning
from descentflow.densities.checkpoint import content_of, density_of, load_model
from descentflow.densities.learn_residual_law import learn_residual_law
from descentflow.densities.mixture import GaussianMixtureDensity
from descentflow.densities.mixture_parameters import Mixture
from descentflow.densities.residual_law import ResidualLaw, components_given, given_component
from descentflow.generation.rejection import sample_descents
from descentflow.representation.linear_curves import Information, linear_curves
from descentflow.training.fit import fit
from descentflow.training.models import mixture_model
from descentflow.training.models.mixture_model import GaussianMixture

D, R, LEVELS = 2, 3, 12
GROUPS = torch.tensor([0, 0, 1])
LAW = ResidualLaw.of_one_scale(
    torch.tensor([[0.2, -0.3, 0.0], [1.0, 0.5, -0.8]]).double(),
    torch.tensor([[0.6, 0.0], [0.0, -0.4], [0.3, 0.2]]).double(),
    torch.tensor([[0.4, 0.4, 0.7], [1.5, 1.5, 0.3]]).double(),
)
TRILS = torch.tensor([[[1.0, 0.0], [0.5, 0.8]], [[0.6, 0.0], [-0.2, 1.1]]]).double()
MIXTURE = Mixture(torch.tensor([0.6, 0.4]).double(), torch.tensor([[-1.5, 0.0], [1.5, 0.5]]).double(), TRILS)


def normal(*shape: int, seed: int = 0) -> Tensor:
    return torch.randn(shape, generator=torch.Generator().manual_seed(seed), dtype=torch.float64)


def drawn(n: int) -> tuple[Tensor, Tensor]:
    """Components (n,), and weights and residual numbers (n, D + R)."""
    component = torch.multinomial(MIXTURE.probs, n, replacement=True, generator=torch.Generator().manual_seed(1))
    weights = MIXTURE.locs[component] + (TRILS[component] @ normal(n, D, 1, seed=2))[..., 0]
    return component, torch.cat([weights, LAW.of(weights, normal(n, R, seed=3), component)], 1)


def observed(u: Tensor, noise: float = 0.3) -> tuple[Information, Tensor, Tensor]:
    """Observed part of u, a third of the flights without the upper half; loadings (LEVELS, D + R), values."""
    loadings, n = normal(LEVELS, D + R, seed=4), len(u)
    values = u @ loadings.T + noise * normal(n, LEVELS, seed=5)
    half = torch.arange(LEVELS) < LEVELS // 2
    group = (torch.arange(n) % 3 == 0).long()
    seen = torch.stack([torch.ones(LEVELS, dtype=torch.bool), half])
    precisions = torch.stack([loadings[one].T @ loadings[one] for one in seen]) / noise**2
    shift = torch.where(seen[group], values, 0.0) @ loadings / noise**2
    return Information(precisions, shift, group), loadings, values


def shares_of(information: Information) -> Tensor:
    """Probability of a component for each flight, by the law that it was drawn of."""
    told, _ = learning._expectation(information, MIXTURE, LAW, torch.ones(len(information.group), 2).double(), None)
    return (told + MIXTURE.probs.log()).softmax(1)


def test_joint_precisions_are_inverse_to_the_roots_covariances() -> None:
    roots = LAW.joint_roots(TRILS)
    both = roots @ roots.mT @ LAW.joint_precisions(TRILS)
    torch.testing.assert_close(both, torch.eye(D + R).double().expand(2, -1, -1), rtol=0, atol=1e-12)


def test_a_standard_law_changes_nothing() -> None:
    plain = ResidualLaw.standard(2, R, D)
    white = normal(5, R)
    assert torch.equal(plain.of(normal(5, D, seed=1), white, torch.tensor([0, 1, 1, 0, 0])), white)
    assert torch.equal(plain.joint_means(MIXTURE.locs)[:, D:], torch.zeros(2, R).double())


def test_flights_are_as_probable_as_scipy_says() -> None:
    """Differences between components of the log-likelihood of observed levels, by SciPy's normal of these levels."""
    information, loadings, values = observed(drawn(6)[1])
    told, _ = learning._expectation(information, MIXTURE, LAW, torch.ones(6, 2).double(), None)
    roots, means = LAW.joint_roots(TRILS), LAW.joint_means(MIXTURE.locs)
    for i in range(6):
        at = torch.arange(LEVELS // 2 if int(information.group[i]) else LEVELS)
        rows = loadings[at]
        by_scipy = [
            multivariate_normal.logpdf(
                values[i, at].numpy(),
                (rows @ means[k]).numpy(),
                (rows @ roots[k] @ roots[k].T @ rows.T + 0.09 * torch.eye(len(at)).double()).numpy(),
            )
            for k in range(2)
        ]
        assert float(told[i, 1] - told[i, 0]) == pytest.approx(by_scipy[1] - by_scipy[0], abs=1e-8)


def most_probable(information: Information) -> ResidualLaw:
    return learning._most_probable(information, GROUPS, MIXTURE, shares_of(information), None)


def test_a_known_law_is_found_again() -> None:
    """3,000 flights: a spread is known to 0.02 (two numbers a spread), an offset of the wider component to 0.06."""
    information, _, _ = observed(drawn(3000)[1])
    found = most_probable(information)
    torch.testing.assert_close(found.spread, LAW.spread, rtol=0.08, atol=0.02)
    torch.testing.assert_close(found.slope, LAW.slope, rtol=0, atol=0.12)
    torch.testing.assert_close(found.offset, LAW.offset, rtol=0, atol=0.25)


def test_residual_numbers_of_a_profile_vary_by_one_over_all_flights() -> None:
    """40,000 draws know one variance to 0.7 %, a mean of two to 0.5 %; ratios of spreads stay as they were."""
    half = ResidualLaw.of_one_scale(LAW.offset / 2, LAW.slope / 2, LAW.spread)
    law = learning._of_unit_variance(half, GROUPS, MIXTURE, MIXTURE.probs.expand(100, -1), None)
    component = torch.multinomial(MIXTURE.probs, 40_000, True, generator=torch.Generator().manual_seed(1))
    weights = MIXTURE.locs[component] + (TRILS[component] @ normal(40_000, D, 1, seed=2))[..., 0]
    varied = law.of(weights, normal(40_000, R, seed=3), component).var(0)
    assert [float(varied[:2].mean()), float(varied[2])] == pytest.approx([1, 1], abs=0.03)
    torch.testing.assert_close(law.spread[1] / law.spread[0], LAW.spread[1] / LAW.spread[0])


def test_no_step_makes_flights_less_probable(monkeypatch: pytest.MonkeyPatch) -> None:
    """The prior is part of what EM raises, and takes less than a thousandth of a nat a flight here."""
    information, _, _ = observed(drawn(2000)[1])
    values = []
    for steps in (1, 2, 4, 8, 16):
        monkeypatch.setattr(learning, "STEPS", steps)
        law = most_probable(information)
        shares = shares_of(information)
        told, _ = learning._expectation(information, MIXTURE, law, shares, None)
        values.append(float((shares * told).sum(1).mean()))
    assert all(later > before - 1e-3 for before, later in pairwise(values))


def test_a_law_that_is_read_again_is_the_same_to_the_bit() -> None:
    """Another layout in memory would round otherwise."""
    information, _, _ = observed(drawn(500)[1])
    first = learn_residual_law(information, GROUPS, MIXTURE, shares_of(information))
    read = ResidualLaw.from_state(first.to_state())
    for mine, again in ((first.offset, read.offset), (first.slope, read.slope), (first.spread, read.spread)):
        assert torch.equal(mine, again)
        assert mine.stride() == again.stride()


def test_many_flights_are_thinned(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    path = toys.write_descents_file(tmp_path / "descents.parquet", 200)
    seen: list[int] = []

    def count(information: Information, *rest: object) -> ResidualLaw:
        seen.append(len(information.group))
        return learn_residual_law(information, *rest)  # type: ignore[arg-type]

    monkeypatch.setattr(mixture_model, "MOST_FLIGHTS", 50)
    monkeypatch.setattr(mixture_model, "learn_residual_law", count)
    assert fit(path, GaussianMixture(n_clusters=2)).density.residual_law is not None
    assert max(seen) <= 50


def test_components_that_weights_suggest_are_as_frequent_as_drawn() -> None:
    """Exact binomial test of the first component's share; p < 1e-4 fails one right sampler in 10,000."""
    component, u = drawn(4000)
    uniform = torch.rand(4000, generator=torch.Generator().manual_seed(9), dtype=torch.float64)
    found = components_given(MIXTURE, u[:, :D], None, uniform)
    assert binomtest(int((found == 0).sum()), 4000, 0.6).pvalue > 1e-4
    assert float((found == component).double().mean()) > 0.8


@pytest.mark.parametrize("named", [True, False])
def test_residual_numbers_are_those_of_the_law(named: bool) -> None:
    """Kolmogorov-Smirnov of each number less its mean by its spread; p < 1e-4 / 3 fails one right sampler in 10,000.

    Where components are not named, weights far apart name them.
    """
    far = Mixture(MIXTURE.probs, 40 * MIXTURE.locs, TRILS)
    density = GaussianMixtureDensity(D, 2)
    density.mixture = far
    density.residual_law = LAW
    component = torch.arange(3000) % 2
    weights = far.locs[component] + normal(3000, D)
    found = density.residual(weights, normal(3000, R, seed=1), 0, components=component if named else None)
    mean = LAW.offset[component] + weights @ LAW.slope.T
    standard = (found - mean) / LAW.spread[component]
    for number in range(R):
        assert kstest(standard[:, number].numpy(), "norm").pvalue > 1e-4 / R


def test_a_fitted_mixture_has_a_law_and_keeps_it(tmp_path: Path) -> None:
    path = toys.write_descents_file(tmp_path / "descents.parquet", 200)
    model = fit(path, GaussianMixture(n_clusters=2), final=False)
    law = model.density.residual_law
    assert law is not None
    content = content_of(model.density)
    again = density_of(content["descentflow"])
    assert again.residual_law is not None
    assert all(torch.equal(getattr(again.residual_law, name), getattr(law, name)) for name in ("offset", "spread"))
    model.save(tmp_path / "best.ckpt")
    loaded, parts = load_model(tmp_path / "best.ckpt"), model.representation
    one, two = (sample_descents(m, parts, 50, 0) for m in (model.density, loaded))
    assert torch.equal(one.trajectories.time_s, two.trajectories.time_s)


def mean_log_likelihood(information: Information, mixture: Mixture, law: ResidualLaw) -> float:
    """Of all flights (nats), of a mixture of one component, up to what laws share."""
    every = torch.ones(len(information.group), dtype=torch.bool)
    told = [given_component(information, mixture, law, 0, every, scale=j).log_density for j in range(len(law.scales))]
    return float((torch.stack(told, 1) + law.scale_probs.log()).logsumexp(1).mean())


def test_held_out_flights_are_more_probable_under_the_law() -> None:
    """Nats a flight, of flights that neither density nor law were fitted to; a law of noise alone would lose some."""
    parts = toys.representation(400)
    decoder = parts.decoder
    d, n_residual = decoder.dimension, linear_curves(decoder).n_residual
    one = Mixture(torch.ones(1).double(), torch.zeros(1, d).double(), torch.eye(d).double()[None])
    train, test = (
        linear_curves(decoder).information(decoder.drag_scale.observed(toys.flights(400, seed=seed))) for seed in (0, 1)
    )
    all_of_it = torch.ones(400, 1).double()
    law = learn_residual_law(train, torch.zeros(n_residual, dtype=torch.long), one, all_of_it)
    plain = ResidualLaw.standard(1, n_residual, d)
    same = ResidualLaw.of_one_scale(law.offset, law.slope, law.spread * (law.scale_probs @ law.scales**2).sqrt())
    told = [mean_log_likelihood(test, one, each) for each in (law, same, plain)]
    assert math.isfinite(told[0])
    assert told[0] > told[1], "flights stray at scales of their own"
    assert told[0] > told[2]
