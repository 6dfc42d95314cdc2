"""Time of one call of `df.Generator`: one descent, 100, and 10,000, of a mixture with another request each time."""

import time
from collections.abc import Callable

import numpy as np
import polars as pl

from benchmarks.timing import print_row
from descentflow.core.units import KT_MPS
from descentflow.densities.density import Density
from descentflow.generation.conditional.generator import Asked, Generator

CALLS = {1: 1000, 100: 60, 10_000: 3}
"""Descents in a call -> calls."""
SLOW_CALLS = {1: 300, 100: 10}
"""The same where each draw is chosen among proposals."""


def requests(generator: Generator) -> dict[str, tuple[Callable[[int], Asked], dict[int, int]]]:
    """Requests by the number of the call, of levels and values that descents of the model have."""
    typical = generator.next_batch(200, entry_fl=_entry_fl(generator))
    entry_fl = _entry_fl(generator)
    flown = typical.trajectories
    at_low = len(generator.levels_fl) // 4
    low, high = generator.levels_fl[at_low], generator.levels_fl[2 * at_low]
    mach, cas_kt, time_s = (
        np.quantile(values.numpy(), (0.3, 0.7))
        for values in (
            flown.mach[:, int(flown.entry[0])],
            flown.cas_mps[:, at_low] / KT_MPS,
            flown.time_s[:, at_low],
        )
    )

    def between(values: np.ndarray, k: int) -> float:
        return float(values[0] + (values[1] - values[0]) * (k * 0.6180339887 % 1.0))

    table = typical.to_polars().filter(sample_id=0).filter(pl.col("level_fl") >= high)
    return {
        "entry level": (lambda k: {"entry_fl": entry_fl - k % 20}, CALLS),
        "and a Mach number": (lambda k: {"entry_fl": entry_fl, "mach": between(mach, k)}, CALLS),
        "and a CAS": (lambda k: {"entry_fl": entry_fl, "cas_kt": {low: between(cas_kt, k)}}, CALLS),
        "and a band of CAS": (
            lambda k: {"entry_fl": entry_fl, "cas_kt": {low: (between(cas_kt, k) - 5, between(cas_kt, k) + 5)}},
            CALLS,
        ),
        "and a time at a level": (
            lambda k: {"entry_fl": entry_fl, "time_s": between(time_s, k), "level": low},
            SLOW_CALLS,
        ),
        "flown so far": (lambda k: {"flown": table}, SLOW_CALLS),
    }


def print_latencies(density: Density) -> None:
    """Print the table: wall time of a call (median and 99 % quantile), and processor time, which other work spares."""
    generator = Generator(density, seed=0)
    print("df.Generator with the mixture, another request at each call")
    print_row(["asked", "descents", "p50 ms", "p99 ms", "CPU p50", "CPU p99", "a second"], 22)
    for name, (asked, sizes) in requests(generator).items():
        for size, calls in sizes.items():
            wall, cpu = np.array([_timed(generator, size, asked(k)) for k in range(-2, calls)])[2:].T * 1e3
            cells = [f"{np.quantile(values, q):.2f}" for values in (wall, cpu) for q in (0.5, 0.99)]
            print_row([name, f"{size:,}", *cells, f"{1e3 * size / np.median(wall):,.0f}"], 22)


def _timed(generator: Generator, size: int, asked: Asked) -> tuple[float, float]:
    begin, cpu = time.perf_counter(), time.thread_time()
    generator.next_batch(size, **asked)
    return time.perf_counter() - begin, time.thread_time() - cpu


def _entry_fl(generator: Generator) -> float:
    """The level from which most flights enter."""
    return generator.levels_fl[int(generator.bounds.entry_counts.argmax())]
