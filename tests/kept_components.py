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

from descentflow.representation import fit_representation
from descentflow.representation.fpca.basis import FunctionalBasis


def keep_components(patch: pytest.MonkeyPatch, folder: Path) -> None:
    """Let fits of equal profiles under equal options give the components that the first of them found."""
    fit = fit_representation.fit_components

    def fit_once(values: Tensor, mask: Tensor, spacing_m: float, share: float, method: str) -> FunctionalBasis:
        if method != "ppca":  # the paper's says in a warning how it went
            return fit(values, mask, spacing_m, share, method)
        name = digest(share, torch.where(mask, values, 0.0), mask, spacing_m)
        return once(folder, name, lambda: fit(values, mask, spacing_m, share, method))

    patch.setattr(fit_representation, "fit_components", fit_once)
