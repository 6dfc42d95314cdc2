"""The sampler as a graph, before any conversion: the density's own draws, contexts, gates, and what is refused."""

import pytest
import torch
from graph_toys import PARTS, density, weights_of
from scipy.stats import chisquare

from descentflow.core.errors import ConfigError
from descentflow.densities.density import Density
from descentflow.densities.flow import MaskedAffineFlowDensity
from descentflow.densities.weight_draws import MixtureDraw
from descentflow.exports.descent_graph import DescentGraph, SamplerGraph
from descentflow.representation.correction import Correction
from descentflow.representation.representation import Representation

D = PARTS.decoder.dimension
N = 50


@pytest.mark.parametrize("kind", ["plain flow", "whitened flow"])
@pytest.mark.parametrize("settings", [{}, {"linear": False}, {"turned_round": False}])
def test_a_flow_draws_what_it_draws(kind: str, settings: dict[str, bool]) -> None:
    model = density(kind, PARTS)
    if settings:
        model = MaskedAffineFlowDensity(D, n_flows=2, whitened=kind == "whitened flow", **settings)
        for parameter in model.flow.parameters():
            parameter.data += 0.1 * torch.randn(parameter.shape, generator=torch.Generator().manual_seed(1))
        model.attach(PARTS)
    model = model.eval().requires_grad_(False).double()
    sampler = SamplerGraph(model)
    noise, weights = weights_of(model, 1, N)
    drawn = sampler(**{**sampler.example_inputs(N), "noise": noise})["weights"]
    torch.testing.assert_close(drawn, weights, rtol=0, atol=1e-12)


@pytest.mark.parametrize("kind", ["gaussian", "mixture", "whitened flow"])
def test_a_context_moves_the_weights_as_the_density_says(kind: str) -> None:
    model = density(kind, PARTS, n_context=2).double()
    sampler = SamplerGraph(model)
    inputs = sampler.example_inputs(N)
    inputs["context"] = torch.randn(N, 2, dtype=torch.float64, generator=torch.Generator().manual_seed(2))
    drawn = sampler(**inputs)["weights"]
    if isinstance(model, MaskedAffineFlowDensity):
        expected = model.of_white(inputs["noise"], inputs["context"])
    else:
        rows = []
        for i in range(N):
            at = model.mixture_at(inputs["context"][i : i + 1])
            assert at is not None
            uniform = inputs.get("uniform", torch.zeros(N))[i]
            k = int((uniform > at.probs.cumsum(0)[:-1]).sum())
            rows.append(at.locs[k] + at.scale_trils[k] @ inputs["noise"][i])
        expected = torch.stack(rows)
    torch.testing.assert_close(drawn, expected, rtol=0, atol=1e-12)


def test_components_are_as_frequent_as_their_proportions() -> None:
    """Chi-square over three components; p < 1e-4 fails one right sampler in 10,000."""
    model = density("mixture", PARTS)
    draw = SamplerGraph(model).draw
    assert isinstance(draw, MixtureDraw)
    uniform = torch.rand(4000, generator=torch.Generator().manual_seed(0), dtype=torch.float64)
    assert model.mixture is not None
    counts = torch.bincount(draw.component(uniform), minlength=3)
    assert chisquare(counts.numpy(), (4000 * model.mixture.probs).numpy()).pvalue > 1e-4


def test_levels_between_and_beyond_the_grid() -> None:
    graph = DescentGraph(PARTS)
    levels = torch.tensor([149.9, 150.0, 250.4, 370.0, 370.1, torch.nan], dtype=torch.float64)
    graphed = graph(torch.zeros(6, D, dtype=torch.float64), levels)
    assert graphed["broken"][:, -1].tolist() == [True, False, False, False, True, True]
    assert not bool(graphed["accepted"][[0, 4, 5]].any())
    assert float(graphed["level_fl"][~graphed["time_s"][2].isnan()].max()) == 250


def test_what_cannot_be_a_graph_is_refused() -> None:
    class OpaqueDensity(MaskedAffineFlowDensity):
        weight_draw = Density.weight_draw

    opaque = OpaqueDensity(D, n_flows=1)
    Density.kinds.pop("OpaqueDensity")
    opaque.attach(PARTS)
    with pytest.raises(ConfigError, match="a OpaqueDensity, whose draws cannot be written as a graph"):
        SamplerGraph(opaque)
    corrected = Representation.from_state(PARTS.to_state())
    corrected.correction = Correction({"temperature": [10.0]}, 64_000.0)
    with pytest.raises(ConfigError, match="a corrected model"):
        DescentGraph(corrected)
