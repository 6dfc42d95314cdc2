"""The density side of flows in few calls: normflows' own log-densities and gradients, to rounding."""

import normflows as nf
import pytest
import torch
from torch import Tensor

from descentflow.densities import layers
from descentflow.densities.flow import FlowDensity, MaskedAffineFlowDensity, SplineFlowDensity
from descentflow.densities.layers import Spline


def flow(kind: type[MaskedAffineFlowDensity | SplineFlowDensity], n_context: int, whitened: bool) -> FlowDensity:
    """With parameters far from where they start, in float64."""
    torch.manual_seed(0)
    found = kind(4, n_flows=3, n_context=n_context, whitened=whitened)
    for parameter in found.parameters():
        parameter.data += 0.3 * torch.randn_like(parameter)
    return found.double()


def score(density: FlowDensity, n_context: int) -> tuple[Tensor, list[Tensor]]:
    """Log-densities, also far from the training flights, and their gradients."""
    generator = torch.Generator().manual_seed(1)
    weights = 3 * torch.randn(200, 4, generator=generator, dtype=torch.float64)
    context = (torch.randn(200, n_context, generator=generator, dtype=torch.float64),) if n_context else ()
    found = density.log_prob(weights, *context)
    parameters = [one for one in density.parameters() if one.requires_grad]
    return found.detach(), list(torch.autograd.grad(found.sum(), parameters))


@pytest.mark.parametrize("kind", [MaskedAffineFlowDensity, SplineFlowDensity])
@pytest.mark.parametrize("n_context", [0, 2])
@pytest.mark.parametrize("whitened", [False, True])
def test_log_densities_and_gradients_are_those_of_normflows(
    kind: type[MaskedAffineFlowDensity | SplineFlowDensity],
    n_context: int,
    whitened: bool,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    density = flow(kind, n_context, whitened)
    ours, gradients = score(density, n_context)
    monkeypatch.setattr(Spline, "inverse", nf.flows.AutoregressiveRationalQuadraticSpline.inverse)
    monkeypatch.setattr(MaskedAffineFlowDensity, "_pass", FlowDensity._pass)
    theirs, expected = score(density, n_context)
    torch.testing.assert_close(ours, theirs, rtol=1e-11, atol=1e-11)
    for one, other in zip(gradients, expected, strict=True):
        torch.testing.assert_close(one, other, rtol=1e-9, atol=1e-9)


def test_parameters_and_permutations_that_are_loaded_are_the_ones_used() -> None:
    """Checkpoints may hold another order of the weights than a new flow has."""
    one, other = flow(MaskedAffineFlowDensity, 0, False), flow(MaskedAffineFlowDensity, 0, False)
    for mix in one.flow.flows[1::2]:
        mix.permutation._permutation.copy_(torch.tensor([2, 0, 3, 1]))
    expected = score(one, 0)[0]
    assert not torch.allclose(score(other, 0)[0], expected)
    other.load_state_dict(one.state_dict())
    assert torch.equal(score(other, 0)[0], expected)


@pytest.mark.parametrize("kind", [MaskedAffineFlowDensity, SplineFlowDensity])
@pytest.mark.parametrize("n_context", [0, 2])
def test_many_rows_have_the_density_that_they_have_alone(
    kind: type[MaskedAffineFlowDensity | SplineFlowDensity], n_context: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Part by part without gradients, all at once with them; products of other sizes round otherwise."""
    monkeypatch.setattr(layers, "ROWS", 7)
    density = flow(kind, n_context, whitened=True)
    weights, context = (torch.randn(30, n, dtype=torch.float64) for n in (4, n_context))
    rest = (context,) if n_context else ()
    whole = density.log_prob(weights, *rest)
    with torch.no_grad():
        parts = density.log_prob(weights, *rest)
    assert whole.requires_grad
    torch.testing.assert_close(parts, whole.detach(), rtol=1e-12, atol=1e-12)
