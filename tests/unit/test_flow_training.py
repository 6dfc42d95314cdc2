"""Training of a flow: where it ends, what too few flights leave of it, and loaded parameters that are used."""

import pytest
import torch
import toys
from lightning.pytorch import Callback, LightningModule, Trainer
from torch import Tensor

from descentflow.core.errors import DescentflowWarning
from descentflow.densities.flow import MaskedAffineFlowDensity
from descentflow.representation.evidence import WeightEvidence
from descentflow.training.models import MaskedAffineFlow
from descentflow.training.models.flow_model import FEWEST_FLIGHTS

D = 3


def weights(n: int, seed: int = 0) -> torch.Tensor:
    return torch.randn(n, D, generator=torch.Generator().manual_seed(seed), dtype=torch.float64)


class Rates(Callback):
    """The learning rate of every epoch, and how many optimiser steps were taken."""

    def __init__(self) -> None:
        self.rates: list[float] = []
        self.steps = 0

    def on_train_epoch_start(self, trainer: Trainer, pl_module: LightningModule) -> None:
        self.rates.append(trainer.optimizers[0].param_groups[0]["lr"])

    def on_train_end(self, trainer: Trainer, pl_module: LightningModule) -> None:
        self.steps = trainer.global_step


@pytest.mark.parametrize(("max_steps", "epochs"), [(None, 6), (9, 4), (8, 4), (100, 6), (1, 1)])
def test_steps_end_training_with_a_whole_epoch(max_steps: int | None, epochs: int) -> None:
    seen, data = Rates(), toys.WeightsModule(weights(100), weights(20, 1), batch_size=50)
    toys.fit(MaskedAffineFlow(n_flows=1, max_steps=max_steps), data, 6, callbacks=[seen])
    assert len(seen.rates) == epochs
    assert seen.steps == 2 * epochs
    if epochs > 1:
        # The Gaussian first; then a cosine from the whole rate, whose zero is the end of the last epoch.
        expected = [
            0.0,
            *(3e-3 * 0.5 * (1 + torch.cos(torch.tensor(torch.pi * i / (epochs - 1)))) for i in range(epochs - 1)),
        ]
        assert seen.rates == pytest.approx([float(one) for one in expected], abs=1e-9)


def test_with_too_few_flights_a_flow_is_its_gaussian() -> None:
    few, held_out = FEWEST_FLIGHTS * D - 1, weights(50, 1)
    with pytest.warns(DescentflowWarning, match=f"{few} training flights for a flow of {D} weights"):
        model = toys.fit(MaskedAffineFlow(n_flows=2), toys.WeightsModule(weights(few), held_out), 20)
    found = model.density.log_prob(held_out).double()
    # The flows are the identity in single precision.
    torch.testing.assert_close(
        found, model.density.base_log_observed(WeightEvidence.of_weights(held_out)), rtol=1e-4, atol=1e-4
    )


def test_one_flight_more_is_trained() -> None:
    held_out = weights(50, 1)
    flow, few = MaskedAffineFlow(n_flows=2, caution=0.0), weights(FEWEST_FLIGHTS * D)
    model = toys.fit(flow, toys.WeightsModule(few, held_out), 3)
    assert model.trainer.current_epoch == 3


def flow() -> MaskedAffineFlowDensity:
    """With parameters far from where they start."""
    torch.manual_seed(0)
    found = MaskedAffineFlowDensity(4, n_flows=3)
    for parameter in found.parameters():
        parameter.data += 0.3 * torch.randn_like(parameter)
    return found.double()


def score(density: MaskedAffineFlowDensity) -> Tensor:
    """Log-densities, also far from the training flights."""
    weights = 3 * torch.randn(200, 4, generator=torch.Generator().manual_seed(1), dtype=torch.float64)
    return density.log_prob(weights).detach()


def test_parameters_and_permutations_that_are_loaded_are_the_ones_used() -> None:
    """Checkpoints may hold another order of the weights than a new flow has."""
    one, other = flow(), flow()
    for mix in one.flow.flows[1::2]:
        mix.permutation._permutation.copy_(torch.tensor([2, 0, 3, 1]))
    expected = score(one)
    assert not torch.allclose(score(other), expected)
    other.load_state_dict(one.state_dict())
    assert torch.equal(score(other), expected)
