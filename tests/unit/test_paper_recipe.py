"""The paper's own recipe: who trains, normflows' own flow, and an fPCA that reports where it runs off."""

import warnings
from pathlib import Path

import pytest
import torch
import toys

from descentflow.core.errors import DescentflowWarning
from descentflow.densities.checkpoint import load_model
from descentflow.representation.fit_representation import RepresentationSettings
from descentflow.representation.fpca.gappy import fit_components
from descentflow.representation.fpca.iterative import MAX_ITERATIONS, iterate
from descentflow.training.datamodule import DescentDataModule
from descentflow.training.fit import fit
from descentflow.training.splitting import SplitSettings


@pytest.fixture(scope="module")
def descents(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("recipe") / "descents.parquet"
    toys.write_descents_file(path, 120)
    return path


def test_all_flights_but_the_test_flights_train(descents: Path) -> None:
    components, split = RepresentationSettings(gaps="filled"), SplitSettings(validation_fraction=0.0)
    data = DescentDataModule(descents, components=components, split=split)
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
