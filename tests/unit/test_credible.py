"""What an effect must be, beside likely, to be named."""

from types import SimpleNamespace

import pytest
import torch

from descentflow.diagnosis.inference import credible
from descentflow.diagnosis.inference.credible import is_credible
from descentflow.effects import EFFECTS


@pytest.mark.parametrize(("share", "named"), [(0.005, False), (0.01, False), (0.012, True), (0.5, True)])
def test_no_effect_is_named_that_no_more_flights_have_than_may_be_odd(
    share: float, named: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """However far it moves the mean: one flight in a hundred may be anything (all else that is asked holds here)."""
    monkeypatch.setattr(credible, "mean_shift", lambda *_: 100.0)
    monkeypatch.setattr(credible, "spreads_as_claimed", lambda *_: True)
    monkeypatch.setattr(credible, "is_of_some", lambda *_: True)
    monkeypatch.setattr(credible, "share_its_own", lambda *_: 1.0)
    name = "geometric_path"
    theta = torch.tensor([share, 0.1, 0.02], dtype=torch.float64)
    likelihood = SimpleNamespace(catalogue={name: EFFECTS[name]}, compared=SimpleNamespace(state=None))
    fit = SimpleNamespace(theta={name: theta}, per_flight={name: None})
    assert is_credible(likelihood, fit, name) is named
