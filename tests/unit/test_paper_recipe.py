"""The paper's own recipe: who trains, normflows' own flow, and an fPCA that reports where it runs off."""

import warnings
from pathlib import Path

import normflows as nf
import pytest
import torch
import toys

from descentflow.configs.packaged_config import config_file
from descentflow.core.errors import DescentflowWarning
from descentflow.densities.checkpoint import load_model
from descentflow.densities.flow import MaskedAffineFlowDensity
from descentflow.representation.fpca._iterative import MAX_ITERATIONS, iterate
from descentflow.representation.fpca.gappy import fit_components
from descentflow.training.datamodule import DescentDataModule
from descentflow.training.fit import fit
from descentflow.training.training_settings import training_settings
from studies.paper.study_plan import RECIPES


@pytest.fixture(scope="module")
def descents(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("recipe") / "descents.parquet"
    toys.write_descents_file(path, 120)
    return path


def test_all_flights_but_the_test_flights_train(descents: Path) -> None:
    data = DescentDataModule(descents, gaps="filled", validation_fraction=0.0)
    data.setup()
    counts = {part: len(data.profiles(part)) for part in ("train", "validation", "test")}
    assert counts["validation"] == 0
    assert counts["train"] == round(0.8 * sum(counts.values()))
    (batch,) = data.val_dataloader()
    assert torch.equal(batch[0].points, data.evidence("train").points)


@pytest.mark.parametrize("name", ["gaussian_paper", "gmm_paper", "flow_paper"])
def test_models_are_fitted_and_read_back(descents: Path, name: str, tmp_path: Path) -> None:
    out = tmp_path / "model.ckpt"
    model = fit(descents, name, out=out, max_epochs=2)
    loaded = load_model(out).held_out_fit
    weights = loaded.sample(5, seed=0)
    with torch.no_grad():
        torch.testing.assert_close(loaded.log_prob(weights), model.log_prob(weights))
    assert loaded.representation.split.validation == ()


def test_the_flow_is_made_of_normflows_own_layers_in_reversed_order() -> None:
    settings = training_settings("flow_paper").model
    kept = {name: settings[name] for name in ("n_flows", "hidden_per_weight", "whitened", "linear", "turned_round")}
    density = MaskedAffineFlowDensity(4, **kept)
    layers = [type(one) for one in density.flow.flows[::2]]
    assert layers == [nf.flows.MaskedAffineAutoregressive] * 5
    assert all(not list(one.parameters()) for one in density.flow.flows[1::2])
    # One hidden layer of two units a weight, behind it a shift and a scale for each of four weights.
    sizes = {tuple(p.shape) for p in density.flow.flows[0].parameters() if p.ndim == 2}
    assert (8, 4) in sizes
    assert (8, 8) in sizes


def test_density_and_samples_of_the_papers_flow_belong_together() -> None:
    """The integral of the density over a plane is one, by a fine grid."""
    torch.manual_seed(0)
    density = MaskedAffineFlowDensity(2, n_flows=3, whitened=False, linear=False, turned_round=False)
    axis = torch.linspace(-6, 6, 241)
    points = torch.cartesian_prod(axis, axis)
    with torch.no_grad():
        total = density.log_prob(points).double().exp().sum() * (12 / 240) ** 2
    # Single precision over 58,081 points.
    assert float(total) == pytest.approx(1.0, abs=1e-3)


def test_the_experiment_is_the_recipe() -> None:
    whole, flow = training_settings(config_file("experiment/paper.yaml")), training_settings("flow_paper")
    assert whole.model == flow.model
    assert whole.trainer == flow.trainer
    assert whole.data.items() >= (flow.data | RECIPES["paper"].data).items()
    assert training_settings("gmm_paper").model["extend"] is False


def rough(n: int, seed: int = 0) -> tuple[torch.Tensor, torch.Tensor]:
    """Curves of one smooth shape and much that is their own at every level; most lack the upper three quarters."""
    generator = torch.Generator().manual_seed(seed)
    level = torch.linspace(0, 1, 40).double()
    values = 100 + torch.randn(n, 1, generator=generator).double() * (0.2 + level)
    values = values + torch.randn(n, 40, generator=generator).double()
    return values, torch.arange(40) < torch.where(torch.rand(n, 1, generator=generator) < 0.7, 10, 40)


def test_an_iteration_that_runs_off_is_told() -> None:
    values, mask = rough(150)
    fitted = iterate(values, mask, 0.95)
    assert not fitted.converged
    assert fitted.n_iterations == MAX_ITERATIONS
    with pytest.warns(DescentflowWarning, match="after 50 iterations the paper's fPCA has not settled"):
        fit_components(values, mask, 30.48, 0.95, "iterative")


def test_without_gaps_the_iteration_settles_at_the_covariance() -> None:
    values, _ = rough(150)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        fitted = iterate(values, torch.ones_like(values) > 0, 0.95)
    assert fitted.converged
    assert fitted.growth == pytest.approx(1.0, rel=1e-9)
