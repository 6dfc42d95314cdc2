"""Components of profiles that were fitted before, for tests of whole runs: most of them train on the same flights.

What fits the components has tests of its own, which fit each time (``tests/reference/test_representation_fpca.py``);
a run is told apart by its profiles, to the bit, and by the options of the fit, so that flights which another path
reads or splits otherwise are fitted anew.
"""

import copy
import hashlib

import pytest
import torch
from torch import Tensor

from descentflow.representation.fpca.gappy import GappyFPCA

_known: dict[str, dict[str, object]] = {}


def _name(options: GappyFPCA, values: Tensor, mask: Tensor, spacing_m: float) -> str:
    """What a fit depends on, as a digest."""
    found = hashlib.sha256(repr((sorted(vars(options).items()), values.shape, values.dtype, spacing_m)).encode())
    for part in (torch.where(mask, values, 0.0), mask):
        found.update(part.cpu().contiguous().numpy().tobytes())
    return found.hexdigest()


def keep_components(patch: pytest.MonkeyPatch) -> None:
    """Let fits of equal profiles under equal options give the components that the first of them found."""
    fit = GappyFPCA.fit

    def once(self: GappyFPCA, values: Tensor, mask: Tensor, spacing_m: float) -> GappyFPCA:
        if self.method != "ppca":  # the paper's says in a warning how it went
            return fit(self, values, mask, spacing_m)
        name = _name(self, values, mask, spacing_m)
        if name not in _known:
            _known[name] = copy.deepcopy(vars(fit(self, values, mask, spacing_m)))
        vars(self).update(copy.deepcopy(_known[name]))
        return self

    patch.setattr(GappyFPCA, "fit", once)
