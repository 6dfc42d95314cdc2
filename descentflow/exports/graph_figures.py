"""Size and speed of an exported sampler, and how far it is from ours."""

from collections.abc import Callable, Mapping
from pathlib import Path
from statistics import median
from time import perf_counter

import torch
from torch import Tensor

from descentflow.exports.descent_graph import SamplerGraph

Run = Callable[[dict[str, Tensor]], Mapping[str, Tensor]]
BATCHES = (1, 100, 10_000)
"""Descents drawn at once."""
REPEATS, SECONDS = 20, 1.0
"""Calls whose median is the speed of a batch, fewer where they take longer than so many seconds."""
COMPARED = 200
"""Descents whose times are held against ours."""


def figures(sampler: SamplerGraph, run: Run, path: Path, runtime: str) -> str:
    """One line: size of the file, time of a call for each size of batch, and the largest difference of the times.

    Args:
        sampler: What was exported.
        run: The exported sampler as it is read back.
        path: Its file.
        runtime: What runs it, for the line.

    Example:
        >>> from descentflow.densities.checkpoint import load_model
        >>> sampler = SamplerGraph(load_model("best.ckpt"))
        >>> print(figures(sampler, lambda inputs: sampler(**inputs), Path("best.ckpt"), "torch"))
        best.ckpt: ... kB; 1 descent in ... ms, 100 in ... ms, 10,000 in ... ms (torch); times within 0 s of ours
    """
    speeds = []
    for n in BATCHES:
        inputs = sampler.example_inputs(n)
        what = "1 descent" if n == 1 else f"{n:,}"
        milliseconds = 1000 * _seconds(run, inputs)
        speeds.append(f"{what} in {milliseconds:{'.0f' if milliseconds >= 100 else '.2g'}} ms")
    apart = difference_s(sampler, run)
    return f"{path.name}: {path.stat().st_size / 1000:.0f} kB; {', '.join(speeds)} ({runtime}); {_within(apart)}"


@torch.no_grad()
def difference_s(sampler: SamplerGraph, run: Run) -> float:
    """The largest difference of the times at any level, in seconds, of draws that are plausible.

    Example:
        >>> from descentflow.densities.checkpoint import load_model
        >>> sampler = SamplerGraph(load_model("best.ckpt"))
        >>> difference_s(sampler, lambda inputs: sampler(**inputs))
        0.0
    """
    inputs = sampler.example_inputs(COMPARED)
    ours, theirs = sampler(**inputs), run(inputs)
    apart = (ours["time_s"].double() - theirs["time_s"].double())[ours["accepted"]]
    return float(apart.nan_to_num().abs().max()) if len(apart) else float("nan")


def _within(apart: float) -> str:
    return "no draw of the comparison was plausible" if apart != apart else f"times within {apart:.1g} s of ours"


def _seconds(run: Run, inputs: dict[str, Tensor]) -> float:
    """Median wall-clock time of a call, after one that is not counted."""
    run(inputs)
    times: list[float] = []
    while len(times) < REPEATS and (not times or sum(times) < SECONDS):
        start = perf_counter()
        run(inputs)
        times.append(perf_counter() - start)
    return median(times)
