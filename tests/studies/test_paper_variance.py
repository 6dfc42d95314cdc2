"""The sweep of explained variance fits once what many shares can have in common."""

import pytest
import torch
import toys

from descentflow.core.units import FL_M
from descentflow.representation.fpca.gappy import fit_components
from studies.paper.variance import truncated


@pytest.mark.parametrize("share", [0.5, 0.8, 0.9])
def test_a_truncated_basis_is_the_one_that_a_fit_of_its_own_finds(share: float) -> None:
    real = toys.flights(120)
    whole, own = (fit_components(real.cas_mps, real.mask, FL_M, s) for s in (0.95, share))
    short = truncated(whole, share)
    assert short.n_components == own.n_components <= whole.n_components
    for name, buffer in own.named_buffers():
        torch.testing.assert_close(getattr(short, name), buffer, rtol=0, atol=0)
