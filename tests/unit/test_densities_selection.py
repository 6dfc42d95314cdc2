"""The best epoch is kept, the Gaussian among them; numbers of components beyond the cap."""

from math import inf
from pathlib import Path

import pytest
import sklearn.mixture
import torch
import toys
import yaml
from toys import normal

from descentflow.densities.component_search import select_mixture
from descentflow.densities.em import fit_mixture
from descentflow.densities.em_steps import Steps
from descentflow.training.models import Gaussian, GaussianMixture, MaskedAffineFlow

CONFIGS = Path(__file__).resolve().parents[2] / "descentflow" / "configs" / "model"
D = 4


def test_few_flights_of_a_gaussian_get_no_worse_than_the_gaussian() -> None:
    """60 flights: a flow that trains on would be nats worse on others."""
    mix = normal(D, D, seed=5)
    module = toys.WeightsModule(normal(60, D) @ mix, normal(15, D, seed=1) @ mix, batch_size=16)
    torch.manual_seed(0)
    flow = toys.fit(MaskedAffineFlow(learning_rate=0.01, steps={"weight_decay": 0.0}), module, 30)
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

    model = toys.fit(Watched(learning_rate=0.05, steps={"caution": 0.0}), module, 8)
    gaussian = toys.fit(Gaussian(), module, 1)
    held_out = module.parts["validation"]
    assert seen[0] == pytest.approx(toys.mean_nll(gaussian.log_prob, held_out), abs=1e-4)
    assert toys.mean_nll(model.log_prob, held_out) == pytest.approx(min(seen), abs=1e-4)
    assert max(seen) > min(seen) + 0.01, "the epochs differ"


def test_shipped_settings_are_the_defaults_and_choose_by_the_bound() -> None:
    config = yaml.safe_load((CONFIGS / "flow.yaml").read_text())
    given, own = config["model"]["init_args"], dict(MaskedAffineFlow().hparams)
    default = own | own["steps"]
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
