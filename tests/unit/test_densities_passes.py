"""The density side of the flow: what a checkpoint brings is what is used."""

import torch
from torch import Tensor

from descentflow.densities.flow import MaskedAffineFlowDensity


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
