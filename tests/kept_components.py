"""Components of profiles that were fitted before, for tests of whole runs: most of them train on the same flights.

What fits the components has tests of its own, which fit each time (``tests/reference/test_representation_fpca.py``);
a run is identified by its profiles, to the bit, and by the options of the fit, so that flights which another path
reads or splits otherwise are fitted anew.
"""

from pathlib import Path

import pytest
import torch
from kept_by_workers import digest, once
from torch import Tensor

from descentflow.representation.fpca.gappy import GappyFPCA


def _name(options: GappyFPCA, values: Tensor, mask: Tensor, spacing_m: float) -> str:
    """Digest of all that a fit depends on."""
    return digest(sorted(vars(options).items()), torch.where(mask, values, 0.0), mask, spacing_m)


def keep_components(patch: pytest.MonkeyPatch, folder: Path) -> None:
    """Let fits of equal profiles under equal options give the components that the first of them found."""
    fit = GappyFPCA.fit

    def fit_once(self: GappyFPCA, values: Tensor, mask: Tensor, spacing_m: float) -> GappyFPCA:
        if self.method != "ppca":  # the paper's says in a warning how it went
            return fit(self, values, mask, spacing_m)
        name = _name(self, values, mask, spacing_m)
        vars(self).update(once(folder, name, lambda: vars(fit(self, values, mask, spacing_m))))
        return self

    patch.setattr(GappyFPCA, "fit", fit_once)
