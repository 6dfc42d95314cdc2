"""Covariances shrunk towards the one that components share: closed form, limits, and flights not seen."""

from math import inf

import pytest
import torch
from sklearn.mixture import GaussianMixture as SklearnMixture
from toys import normal

from descentflow.densities.em import fit_mixture
from descentflow.densities.em_steps import Steps
from descentflow.densities.mixture_parameters import log_observed, without_flight
from descentflow.representation.evidence import WeightEvidence

D = 5


def drawn(n: int, seed: int) -> torch.Tensor:
    """Three clusters, of which two are narrow, with correlations of their own."""
    roots = torch.stack(
        [torch.eye(D).double() * scale + 0.1 * normal(D, D, seed=s) for s, scale in enumerate((1, 0.3, 0.3))]
    )
    of = torch.randint(3, (n,), generator=torch.Generator().manual_seed(seed))
    return 3.0 * normal(3, D, seed=9)[of] + (roots[of] @ normal(n, D, seed=seed + 100)[..., None])[..., 0]


def test_the_limit_is_scikit_learns_tied_mixture() -> None:
    weights = drawn(600, 2)
    tied = SklearnMixture(3, covariance_type="tied", random_state=0, n_init=5, tol=1e-9, max_iter=1000).fit(weights)
    ours, likelihood = fit_mixture(Steps(weights, prior_flights=1e12), 3, seed=0)
    # Both stop at the maximum: to within the jitter of 1e-6 that both add, and the last steps.
    assert likelihood == pytest.approx(tied.score(weights), abs=1e-4)
    found = ours.scale_trils[0] @ ours.scale_trils[0].T
    torch.testing.assert_close(found, torch.from_numpy(tied.covariances_), rtol=1e-2, atol=1e-3)


@pytest.mark.parametrize("prior", [0.0, inf])
def test_a_mixture_less_one_flight_is_the_one_of_the_others(prior: float) -> None:
    """Of three clusters far apart, whose flights belong to one each: with own covariances and with one."""
    labels = torch.arange(90) % 3
    points, shares = 100.0 * normal(3, D, seed=9)[labels] + normal(90, D), torch.nn.functional.one_hot(labels).double()
    found = without_flight(Steps(points, None, prior).maximise(shares), points[:1], 90)
    expected = Steps(points[1:], None, prior).maximise(shares[1:])
    torch.testing.assert_close(found.probs, expected.probs)
    torch.testing.assert_close(found.locs, expected.locs)
    covariances = (one.scale_trils @ one.scale_trils.mT for one in (found, expected))
    torch.testing.assert_close(*covariances, rtol=1e-5, atol=1e-5)  # the jitter of 1e-6 is added to one flight fewer


def test_flights_not_seen_are_more_probable_where_few_teach() -> None:
    """Eight components of 120 flights: with five flights of what they share, others are more probable by half a nat."""
    train, others = drawn(120, 5), WeightEvidence.of_weights(drawn(2000, 6))
    steps = (Steps(train, prior_flights=prior) for prior in (0.0, 5.0))
    without, shrunk = (log_observed(fit_mixture(one, 8, seed=0, n_restarts=2)[0], others).mean() for one in steps)
    assert float(shrunk) > float(without) + 0.5
