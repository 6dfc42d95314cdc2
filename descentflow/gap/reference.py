"""What a simulator says is normal: its own flights as its checkpoint keeps them, or samples where it keeps none."""

from typing import TYPE_CHECKING

import numpy as np
import torch
from torch import Tensor

from descentflow.errors import DataError
from descentflow.gap.levels import LevelGrid
from descentflow.gap.quantities import Quantities, measured
from descentflow.sampling.rejection import sample_descents
from descentflow.units import FPM_MPS, KT_MPS

if TYPE_CHECKING:
    from descentflow.gap.engine import Simulator

SAMPLES = 1000
SAMPLED = ("cas",)
"""Quantities besides the rate that samples say something about; the rest is what physics claims."""


def reference_of(simulator: "Simulator", real: LevelGrid, seed: int) -> tuple[Quantities | None, str]:
    """The simulator's flights, and where they come from: ``training flights``, ``samples`` or ``physics``.

    Raises:
        DataError: If the checkpoint's own flights were measured in another way.
    """
    parts = simulator.representation
    if parts is None or simulator.sampler is None:
        return None, "physics"
    if parts.reference is not None:
        try:
            return Quantities.from_state(parts.reference), "training flights"
        except KeyError as error:
            raise DataError(
                f"a checkpoint with {error.args[0]}",
                expected="one of this version of descentflow",
                mend="fit it again",
            ) from error
    return _samples(simulator, real, seed), "samples"


def _samples(simulator: "Simulator", real: LevelGrid, seed: int) -> Quantities:
    """Samples seen through the gaps of real flights, each flight an aircraft of its own."""
    parts = simulator.representation
    assert parts is not None
    assert simulator.sampler is not None
    generator = np.random.default_rng(seed)
    levels = parts.decoder.levels_fl.cpu()
    mask = real.mask
    chosen = torch.from_numpy(generator.integers(0, len(mask), SAMPLES))
    top = mask.shape[1] - 1 - mask.flip(1).to(torch.int8).argmax(1)
    flown = sample_descents(simulator.sampler, parts.decoder, parts.plausibility, SAMPLES, seed, entry=top).trajectories
    # Each sample takes the gaps of a real flight; levels above its own entry have no meaning.
    seen = mask[chosen] & flown.mask.cpu()

    def shown(values: Tensor) -> Tensor:
        return torch.where(seen, values.detach().double().cpu(), torch.nan)

    grid = LevelGrid(
        levels,
        shown(flown.time_s),
        {"IAS": shown(flown.cas_mps / KT_MPS), "vertical_rate": shown(flown.rate_mps / FPM_MPS)},
        torch.arange(SAMPLES),
        tuple(f"sample-{i}" for i in range(SAMPLES)),
    )
    found = measured(grid)
    return Quantities(
        found.levels_fl,
        found.band_fl,
        {name: value for name, value in found.values.items() if name in SAMPLED},
        found.physics,
        found.cluster,
    )
