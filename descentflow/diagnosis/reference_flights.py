"""What a simulator says is normal: its own flights as its checkpoint keeps them, or samples where it keeps none."""

import numpy as np
import torch
from torch import Tensor

from descentflow.core.errors import DataError
from descentflow.core.units import FPM_MPS, KT_MPS
from descentflow.diagnosis.simulator import Simulator
from descentflow.generation.rejection import sample_descents
from descentflow.measurements.level_channels import LevelGrid
from descentflow.measurements.quantities import Quantities, measured
from descentflow.representation.decoder.descent_decoder import DescentDecoder
from descentflow.representation.decoder.trajectories import Trajectories
from descentflow.representation.profiles import Profiles, infer_drag_n

SAMPLES = 1000
"""Drawn where a checkpoint keeps no flights: means to a thirtieth of the spread between flights."""
SAMPLED = ("cas",)
"""Quantities besides the rate that samples say something about; the rest is what physics claims."""


def both_sides(simulator: Simulator, grid: LevelGrid, seed: int) -> tuple[Quantities | None, Quantities, str]:
    """The simulator's flights, the real ones, and where the former come from.

    That is ``training flights``, ``samples`` or ``physics``. Samples are made of a few components, which real flights
    are not: then the real flights' speeds and rates are taken through the same components before they are measured.

    Raises:
        DataError: If the checkpoint's own flights were measured in another way.

    Example:
        >>> from descentflow.diagnosis.open_simulator import open_simulator
        >>> from descentflow.measurements.quantities import CHANNELS, grid_of
        >>> from descentflow.surveillance.descents.prepared_descents import read_descents
        >>> grid = grid_of(read_descents("descents.parquet").frame, 150, 340, CHANNELS)
        >>> both_sides(open_simulator("best.ckpt"), grid, seed=0)[2]
        'training flights'
    """
    parts = simulator.representation
    real = measured(grid)
    if parts is None or simulator.sampler is None:
        return None, real, "physics"
    if parts.reference is not None:
        try:
            return Quantities.from_state(parts.reference), real, "training flights"
        except KeyError as error:
            raise DataError(
                f"a checkpoint with {error.args[0]}",
                expected="one of this version of descentflow",
                mend="fit it again",
            ) from error
    return _samples(simulator, grid, seed), _by_components(parts.decoder, grid, real), "samples"


def _by_components(decoder: DescentDecoder, grid: LevelGrid, real: Quantities) -> Quantities:
    """Real flights with the speeds and rates of their own components; all else as measured."""
    seen = grid.mask
    altitude = grid.altitude_m
    cas = torch.where(seen, grid.values["IAS"], 250.0) * KT_MPS
    rate = torch.where(seen, grid.values["vertical_rate"], -1500.0) * FPM_MPS
    drag = torch.where(seen, infer_drag_n(decoder.aircraft, cas, rate, altitude), 0.0)
    blank = torch.zeros_like(cas)
    profiles = Profiles(grid.flight_ids, grid.levels_fl, blank, cas, rate, drag, seen)
    with torch.no_grad():
        flown = decoder(decoder.encode(profiles), profiles.entry_level)
    smooth = measured(_shown(grid, flown, seen, grid.airframe, grid.flight_ids))
    if len(smooth) != len(real):
        raise DataError(
            "flights that lose their bands in the simulator's components",
            expected="descents that the simulator can represent",
            mend="use a checkpoint of this version, which keeps its own flights",
        )
    values = {**real.values, **{name: smooth.values[name] for name in SAMPLED}}
    physics = {**smooth.physics, "tailwind_mps": real.physics["tailwind_mps"]}
    return Quantities(real.levels_fl, real.band_fl, values, physics, real.airframe)


def _shown(like: LevelGrid, flown: Trajectories, seen: Tensor, airframe: Tensor, names: tuple[str, ...]) -> LevelGrid:
    """Decoded descents where they are seen."""

    def shown(values: Tensor) -> Tensor:
        return torch.where(seen, values.detach().double().cpu(), torch.nan)

    channels = {"IAS": shown(flown.cas_mps / KT_MPS), "vertical_rate": shown(flown.rate_mps / FPM_MPS)}
    return LevelGrid(like.levels_fl, shown(flown.time_s), channels, airframe, names)


def _samples(simulator: Simulator, real: LevelGrid, seed: int) -> Quantities:
    """Samples seen through the gaps of real flights, each flight an aircraft of its own."""
    parts = simulator.representation
    assert parts is not None
    assert simulator.sampler is not None
    generator = np.random.default_rng(seed)
    mask = real.mask
    chosen = torch.from_numpy(generator.integers(0, len(mask), SAMPLES))
    top = mask.shape[1] - 1 - mask.flip(1).to(torch.int8).argmax(1)
    flown = sample_descents(simulator.sampler, parts.decoder, parts.plausibility, SAMPLES, seed, entry=top).trajectories
    # Each sample takes the gaps of a real flight; levels above its own entry have no meaning.
    seen = mask[chosen] & flown.mask.cpu()
    names = tuple(f"sample-{i}" for i in range(SAMPLES))
    found = measured(_shown(real, flown, seen, torch.arange(SAMPLES), names))
    return Quantities(
        found.levels_fl,
        found.band_fl,
        {name: value for name, value in found.values.items() if name in SAMPLED},
        found.physics,
        found.airframe,
    )
