"""Checkpoints of mixtures with a part replaced: refused when they are loaded, not when samples are drawn."""

import pytest

from descentflow.densities.entry_gate import EntryGate
from descentflow.densities.mixture import GaussianMixtureDensity
from descentflow.densities.residual_law import ResidualLaw

GATE = {"edges": [3, 7], "shares": [[1.0, 0.0], [0.5, 0.5], [0.2, 0.8]]}
LAW = {"offset": [[0.0], [1.0]], "slope": [[1.0, 2.0, 3.0]], "spread": [[1.0], [2.0]]}
SCALED = LAW | {"scales": [[0.5], [2.0]], "scale_probs": [0.8, 0.2]}


def test_whole_ones_pass() -> None:
    EntryGate.from_state(GATE).check(2)
    for law in (LAW, SCALED):
        ResidualLaw.from_state(law).check(2, 3)
        GaussianMixtureDensity(3, n_clusters=2, entry_gate=GATE, residual_law=law)
    assert ResidualLaw.from_state(LAW).to_state() == LAW | {"scales": [[1.0]], "scale_probs": [1.0]}, (
        "as it was saved once"
    )


@pytest.mark.parametrize(
    "change",
    [
        {"shares": GATE["shares"][:2]},
        {"shares": [[1.0, float("nan")], [0.5, 0.5], [0.2, 0.8]]},
        {"shares": [[1.5, -0.5], [0.5, 0.5], [0.2, 0.8]]},
        {"shares": [[1.0, 1.0], [0.5, 0.5], [0.2, 0.8]]},
        {"edges": [7, 3]},
        {"edges": []},
    ],
)
def test_gates_that_are_none(change: dict) -> None:
    with pytest.raises(ValueError, match="entry gate"):
        GaussianMixtureDensity(3, n_clusters=2, entry_gate=GATE | change)


@pytest.mark.parametrize(
    "change",
    [
        {"spread": [1.0, 2.0]},
        {"spread": [[1.0], [-1.0]]},
        {"spread": [[1.0], [float("nan")]]},
        {"offset": [[0.0]]},
        {"slope": [[1.0, 2.0]]},
        {"slope": [1.0, 2.0, 3.0]},
        {"scales": [[0.5]]},
        {"scales": [0.5, 2.0]},
        {"scales": [[0.5], [-2.0]]},
        {"scales": [[0.5, 1.0], [2.0, 1.0]]},
        {"scale_probs": [0.8]},
        {"scale_probs": [1.8, -0.8]},
        {"scale_probs": [0.0, 0.0]},
        {"scale_probs": []},
    ],
)
def test_residual_laws_that_are_none(change: dict) -> None:
    with pytest.raises(ValueError, match="residual law"):
        GaussianMixtureDensity(3, n_clusters=2, residual_law=SCALED | change)
