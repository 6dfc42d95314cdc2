"""Covariances shrunk towards the one that components share: closed form, limits, and flights not seen."""

import pytest
import torch
from sklearn.mixture import GaussianMixture as SklearnMixture

from descentflow.densities.em import fit_mixture, steps_of
from descentflow.densities.em_steps import shrunk
from descentflow.densities.mixture_parameters import log_observed
from descentflow.representation.evidence import Evidence

D = 5


def normal(*shape: int, seed: int = 0) -> torch.Tensor:
    return torch.randn(*shape, generator=torch.Generator().manual_seed(seed), dtype=torch.float64)


def drawn(n: int, seed: int) -> torch.Tensor:
    """Three clusters, of which two are narrow, with correlations of their own."""
    roots = torch.stack(
        [torch.eye(D).double() * scale + 0.1 * normal(D, D, seed=s) for s, scale in enumerate((1, 0.3, 0.3))]
    )
    of = torch.randint(3, (n,), generator=torch.Generator().manual_seed(seed))
    return 3.0 * normal(3, D, seed=9)[of] + (roots[of] @ normal(n, D, seed=seed + 100)[..., None])[..., 0]


def test_the_shared_covariance_stays_the_same() -> None:
    """Shrunk about their mean over the flights, covariances have that mean still where flights are equally many."""
    roots = normal(3 * D, D).reshape(3, D, D)
    own = roots @ roots.mT
    counts = torch.full((3,), 40.0).double()
    torch.testing.assert_close(shrunk(own, counts, 7.0).mean(0), own.mean(0))
    assert torch.equal(shrunk(own, counts, 0.0), own)
    assert torch.equal(shrunk(own[:1], counts[:1], 7.0), own[:1]), "one component shares with none"


@pytest.mark.parametrize("context", [False, True])
def test_with_very_many_prior_flights_all_components_are_alike(context: bool) -> None:
    weights, given = drawn(300, 1), normal(300, 1, seed=3) if context else None
    steps = steps_of(weights, given, 1e9)
    labels = torch.nn.functional.one_hot(torch.arange(300) % 3, 3).double()
    factors = steps.maximise(labels).scale_trils
    torch.testing.assert_close(factors[1], factors[0], rtol=1e-6, atol=1e-9)
    own = steps_of(weights, given).maximise(labels).scale_trils
    assert not torch.allclose(own[1], own[0], rtol=1e-2)


def test_the_limit_is_scikit_learns_tied_mixture() -> None:
    weights = drawn(600, 2)
    tied = SklearnMixture(3, covariance_type="tied", random_state=0, n_init=5, tol=1e-9, max_iter=1000).fit(weights)
    ours, likelihood = fit_mixture(weights, 3, seed=0, prior_flights=1e12)
    # Both stop at the maximum: to within the jitter of 1e-6 that both add, and the last steps.
    assert likelihood == pytest.approx(tied.score(weights), abs=1e-4)
    found = ours.scale_trils[0] @ ours.scale_trils[0].T
    torch.testing.assert_close(found, torch.from_numpy(tied.covariances_), rtol=1e-2, atol=1e-3)


def test_flights_not_seen_are_more_probable_where_few_teach() -> None:
    """Eight components of 120 flights: with five flights of what they share, others are more probable by half a nat."""
    train, others = drawn(120, 5), Evidence.of_weights(drawn(2000, 6))
    held = {
        prior: float(log_observed(fit_mixture(train, 8, seed=0, n_restarts=2, prior_flights=prior)[0], others).mean())
        for prior in (0.0, 5.0)
    }
    assert held[5.0] > held[0.0] + 0.5
