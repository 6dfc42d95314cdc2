"""The sweep of explained variance fits once what many shares can have in common."""

import pytest
import torch
import toys

from descentflow.core.units import FL_M
from descentflow.representation.fpca.gappy import fit_components
from studies.paper.variance import fold_scores, truncated


@pytest.mark.parametrize("share", [0.5, 0.8, 0.9])
def test_a_truncated_basis_is_the_one_that_a_fit_of_its_own_finds(share: float) -> None:
    real = toys.flights(120)
    whole, own = (fit_components(real.cas_mps, real.mask, FL_M, s) for s in (0.95, share))
    short = truncated(whole, share)
    assert short.n_components == own.n_components <= whole.n_components
    for name, buffer in own.named_buffers():
        torch.testing.assert_close(getattr(short, name), buffer, rtol=0, atol=0)


def test_folds_part_the_flights_and_every_share_has_its_scores() -> None:
    real = toys.flights(120)
    found = fold_scores(real, toys.AIRCRAFT, 300.0, 1, 2, (0.5, 0.9))
    assert found.group_by("share", "quantity", maintain_order=True).len()["len"].to_list() == [3] * 4
    assert found.filter(share=0.5)["components"][0] <= found.filter(share=0.9)["components"][0]
    assert found["score"].is_not_nan().all()
