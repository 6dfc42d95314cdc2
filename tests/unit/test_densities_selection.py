"""Choices of a fit: the best epoch, the number of components, and covariances that are shared or shrunk."""

from math import inf
from pathlib import Path

import pytest
import sklearn.mixture
import torch
import toys
import yaml
from sklearn.mixture import GaussianMixture as SklearnMixture
from toys import normal

from descentflow.densities.component_search import select_mixture
from descentflow.densities.em import fit_mixture
from descentflow.densities.em_steps import Steps
from descentflow.densities.mixture_parameters import log_observed, without_flight
from descentflow.representation.evidence import WeightEvidence
from descentflow.training.models import Gaussian, GaussianMixture, MaskedAffineFlow

CONFIGS = Path(__file__).resolve().parents[2] / "descentflow" / "configs" / "model"
D = 4


def test_few_flights_of_a_gaussian_get_no_worse_than_the_gaussian() -> None:
    """60 flights: a flow that trains on would be nats worse on others."""
    mix = normal(D, D, seed=5)
    module = toys.WeightsModule(normal(60, D) @ mix, normal(15, D, seed=1) @ mix, batch_size=16)
    torch.manual_seed(0)
    flow = toys.fit(MaskedAffineFlow(learning_rate=0.01, weight_decay=0.0), module, 30)
    gaussian = toys.fit(Gaussian(), module, 1)
    others = normal(4000, D, seed=2) @ mix
    assert toys.mean_nll(flow.log_prob, others) < toys.mean_nll(gaussian.log_prob, others) + 0.05


def test_first_epoch_is_the_gaussian_and_the_best_is_kept() -> None:
    module = toys.WeightsModule(normal(200, D), normal(50, D, seed=1), batch_size=64)
    seen: list[float] = []

    class Watched(MaskedAffineFlow):
        def on_validation_epoch_end(self) -> None:
            super().on_validation_epoch_end()
            seen.append(float(self.trainer.callback_metrics["val/bound"]))

    model = toys.fit(Watched(learning_rate=0.05, caution=0.0), module, 8)
    gaussian = toys.fit(Gaussian(), module, 1)
    held_out = module.parts["validation"]
    assert seen[0] == pytest.approx(toys.mean_nll(gaussian.log_prob, held_out), abs=1e-4)
    assert toys.mean_nll(model.log_prob, held_out) == pytest.approx(min(seen), abs=1e-4)
    assert max(seen) > min(seen) + 0.01, "the epochs differ"


def test_shipped_settings_are_the_defaults_and_choose_by_the_bound() -> None:
    config = yaml.safe_load((CONFIGS / "flow.yaml").read_text())
    given, default = config["model"]["init_args"], dict(MaskedAffineFlow().hparams)
    assert {key: float(value) for key, value in given.items()} == {key: float(default[key]) for key in given}
    assert config["checkpoint"]["monitor"] == "val/bound"
    assert config["trainer"]["callbacks"][0]["init_args"]["monitor"] == "val/bound"


def test_the_search_ends_where_two_numbers_in_a_row_are_no_better() -> None:
    """Four clusters in a plane."""
    centres = torch.tensor([[0.0, 6.0], [6.0, 0.0], [-6.0, -6.0], [-6.0, 6.0]]).double()
    points = centres[torch.arange(900) % 4] + normal(900, 2)
    found = select_mixture(points, seed=0, n_restarts=2)
    assert found.mixture.n_components == 4
    assert list(found.values) == [1, 2, 3, 4, 6, 8]
    assert not found.cap_binds
    few = select_mixture(points[:300], seed=0, n_restarts=2, extend=False)
    assert (list(few.values), few.cap_binds) == ([1, 2, 3], True), "the cap of 300 flights"


def test_components_of_one_covariance_are_those_of_scikit_learn() -> None:
    """Three clusters in six numbers: the parameters, likelihood and criterion of ``tied``, and its covariance."""
    centres = 4 * torch.eye(6).double()[:3]
    points = (centres[torch.arange(300) % 3] + normal(300, 6)) @ normal(6, 6, seed=1)
    steps = Steps(points, None, inf)
    found, (mixture, _) = (
        select_mixture(steps, seed=0, n_restarts=4, criterion="aic"),
        fit_mixture(steps, 3, seed=0),
    )
    theirs = sklearn.mixture.GaussianMixture(
        3, covariance_type="tied", n_init=4, tol=1e-8, max_iter=500, random_state=0
    )
    theirs.fit(points)
    assert found.values[3] == pytest.approx(theirs.aic(points), abs=1e-3)
    covariances = mixture.scale_trils @ mixture.scale_trils.mT
    torch.testing.assert_close(covariances, torch.from_numpy(theirs.covariances_).expand(3, 6, 6), rtol=1e-3, atol=1e-3)


def test_few_flights_of_several_kinds_get_components_of_one_covariance() -> None:
    """Of 60 flights in six numbers two covariances are too many parameters; the final fit takes the same."""
    centres = 6 * torch.eye(6).double()[:3]
    points = centres[torch.arange(60) % 3] + normal(60, 6)
    module, model = toys.WeightsModule(points, points[:30]), GaussianMixture(n_restarts=4)
    mixture = toys.fit(model, module, 1).density.mixture
    assert mixture.n_components >= 3
    assert bool((mixture.scale_trils == mixture.scale_trils[0]).all())
    again = GaussianMixture(n_restarts=4)
    again.choose_as(model)
    torch.testing.assert_close(toys.fit(again, module, 1).density.mixture.scale_trils, mixture.scale_trils)


def test_enough_flights_for_two_covariances_keep_them() -> None:
    """Of 140 in six numbers the criterion has two covariances to choose at most, and three kinds that ask for more."""
    centres = 6 * torch.eye(6).double()[:3]
    points = centres[torch.arange(140) % 3] + normal(140, 6)
    mixture = toys.fit(GaussianMixture(n_restarts=4), toys.WeightsModule(points, points[:30]), 1).density.mixture
    assert mixture.n_components == 2
    assert not bool((mixture.scale_trils == mixture.scale_trils[0]).all())


def test_the_model_says_that_its_cap_decides(capsys: pytest.CaptureFixture[str]) -> None:
    weights = normal(400, D) * torch.where(normal(400, 1, seed=3) > 0, 3.0, 0.2) + 4 * normal(400, 1, seed=4).sign()
    toys.fit(GaussianMixture(extend=False, n_restarts=2), toys.WeightsModule(weights, weights[:50]), 1)
    assert "the cap of 15 flights per parameter decides" in capsys.readouterr().out


DIM = 5


def drawn(n: int, seed: int) -> torch.Tensor:
    """Three clusters, of which two are narrow, with correlations of their own."""
    roots = torch.stack(
        [torch.eye(DIM).double() * scale + 0.1 * normal(DIM, DIM, seed=s) for s, scale in enumerate((1, 0.3, 0.3))]
    )
    of = torch.randint(3, (n,), generator=torch.Generator().manual_seed(seed))
    return 3.0 * normal(3, DIM, seed=9)[of] + (roots[of] @ normal(n, DIM, seed=seed + 100)[..., None])[..., 0]


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
    points, shares = (
        100.0 * normal(3, DIM, seed=9)[labels] + normal(90, DIM),
        torch.nn.functional.one_hot(labels).double(),
    )
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
