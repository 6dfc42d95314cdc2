"""The decoder without gradients: fused arithmetic in cache-sized chunks, one chunk a thread."""

from concurrent.futures import ThreadPoolExecutor

import torch
from torch import Tensor

from descentflow.decoder.breaks import Breaks, rate_breaks
from descentflow.performance.aircraft import Aircraft, Number
from descentflow.performance.level_table import LevelTable, fused_rate, level_table

CHUNK_VALUES = 1 << 17
"""Values of a quantity in one chunk on the CPU: the handful of arrays in use stay in the second-level cache."""


def is_plain(*values: object) -> bool:
    """Whether none of the values is a tensor that varies by flight or asks for a gradient."""
    return not any(isinstance(value, Tensor) and (value.requires_grad or value.numel() > 1) for value in values)


def integrate_fast(
    aircraft: Aircraft,
    altitude_m: Tensor,
    drag_n: Tensor,
    cas_mps: Tensor,
    entry: Tensor,
    mass_kg: Number | None,
    deviation_k: Number,
) -> tuple[Tensor, Tensor, Tensor, Tensor]:
    """Time, Mach, TAS and rate, each (n, L): the numbers of the plain path to rounding.

    Args:
        aircraft: Coefficients, all floats.
        altitude_m: (L,) in the profiles' precision.
        drag_n: (n, L).
        cas_mps: (n, L).
        entry: (n,) index of the entry level.
        mass_kg: Mass; the reference mass if absent.
        deviation_k: ISA temperature deviation.
    """
    breaks = rate_breaks(aircraft, altitude_m)
    tables = tuple(level_table(aircraft, h, mass_kg, deviation_k) for h in (altitude_m, breaks.altitude_m))
    half_step_m = 0.5 * torch.cat([altitude_m, breaks.altitude_m])[breaks.order].diff()
    outputs = tuple(torch.empty_like(drag_n) for _ in range(4))
    size = len(drag_n) if drag_n.is_cuda else max(CHUNK_VALUES // drag_n.shape[1], 1)

    inference = torch.is_inference_mode_enabled()

    def work(start: int) -> None:
        part = slice(start, start + size)
        out = tuple(values[part] for values in outputs)
        # The mode belongs to a thread, and tensors made in it may not be written outside it.
        with torch.inference_mode(inference):
            _chunk(tables, breaks, half_step_m, drag_n[part], cas_mps[part], entry[part], out)

    starts = range(0, len(drag_n), size)
    if len(starts) == 1 or torch.get_num_threads() == 1:
        for start in starts:
            work(start)
    else:
        # torch releases the interpreter inside each operation, so threads run chunks side by side.
        with ThreadPoolExecutor(torch.get_num_threads()) as pool:
            list(pool.map(work, starts))
    time_s, mach, tas_mps, rate_mps = outputs
    return time_s, mach, tas_mps, rate_mps


@torch.no_grad()
def _chunk(
    tables: tuple[LevelTable, ...],
    breaks: Breaks,
    half_step_m: Tensor,
    drag_n: Tensor,
    cas_mps: Tensor,
    entry: Tensor,
    out: tuple[Tensor, ...],
) -> None:
    time_s, mach, tas_mps, rate_mps = out
    fused_rate(tables[0], drag_n, cas_mps, (mach, tas_mps, rate_mps, time_s))
    n, n_extra = len(drag_n), len(breaks.base)
    every = drag_n.new_empty(n, drag_n.shape[1] + n_extra)
    every[:, : drag_n.shape[1]] = rate_mps
    if n_extra:
        scratch = tuple(drag_n.new_empty(n, n_extra) for _ in range(4))
        fused_rate(tables[1], breaks.continued(drag_n), breaks.continued(cas_mps), scratch)
        every[:, drag_n.shape[1] :] = scratch[2]
        every = every[:, breaks.order]
    every.reciprocal_()
    legs = (every[:, 1:] + every[:, :-1]).mul_(half_step_m)
    # Seconds gained on the way up are negative here: the rate is.
    fallen = torch.nn.functional.pad(legs.cumsum_(1), (1, 0))
    if n_extra:
        fallen = fallen[:, breaks.levels_at]
    torch.sub(fallen, fallen.gather(1, entry[:, None]), out=time_s)
