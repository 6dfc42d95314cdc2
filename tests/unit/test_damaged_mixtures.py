"""Checkpoints of mixtures with a part replaced: refused when they are loaded, not when samples are drawn."""

import pytest

from descentflow.densities.entry_gate import EntryGate
from descentflow.densities.mixture import GaussianMixtureDensity

GATE = {"edges": [3, 7], "shares": [[1.0, 0.0], [0.5, 0.5], [0.2, 0.8]]}


def test_whole_ones_pass() -> None:
    EntryGate.from_state(GATE).check(2)
    GaussianMixtureDensity(3, n_clusters=2, entry_gate=GATE)


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
