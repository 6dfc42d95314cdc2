"""Measure speed beside limits and peers, in one run: python scripts/benchmark.py decode."""

import argparse
import os
import subprocess
import sys
import time
import warnings
from collections.abc import Callable

import torch
from benchmarks.prepare import prepare
from torch import Tensor

from descentflow.decoder.trajectories import integrate, integrate_plain
from descentflow.performance.registry import aircraft
from descentflow.units import FL_M

N_DESCENTS, N_LEVELS = 10_000, 228


def best_of(work: Callable[[], object], repeats: int = 7) -> float:
    """Shortest wall time of a few runs (s), after one that does not count."""
    work()
    times = []
    for _ in range(repeats):
        start = time.perf_counter()
        work()
        times.append(time.perf_counter() - start)
    return min(times)


def pybada_descent_s() -> float | None:
    """Seconds of pyBADA's FL370-150 descent of its dummy J2M at 1,000 ft steps; None where pyBADA is absent."""
    try:
        from pyBADA.bada3 import Bada3Aircraft
        from pyBADA.trajectorySegments import constantSpeedRating
    except ImportError:
        return None
    dummy = Bada3Aircraft(badaVersion="DUMMY", acName="J2M")
    common = {"AC": dummy, "m_init": 58_000, "deltaTemp": 0, "Hp_step": 1000}

    def fly() -> None:
        constantSpeedRating(speedType="M", v=0.74, Hp_init=37_000, Hp_final=28_229, **common)
        constantSpeedRating(speedType="CAS", v=290, Hp_init=28_229, Hp_final=15_000, **common)

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return best_of(fly, repeats=3)


def profiles(dtype: torch.dtype, n: int = N_DESCENTS) -> tuple[Tensor, Tensor, Tensor, Tensor, Tensor]:
    """Levels, altitudes, drag, CAS and entries of n plausible descents."""
    generator = torch.Generator().manual_seed(0)
    levels = torch.arange(150, 150 + N_LEVELS, dtype=torch.float64)
    drag = 40_000 + 1_000 * torch.randn(n, N_LEVELS, generator=generator, dtype=torch.float64)
    cas = 140 + 2 * torch.randn(n, N_LEVELS, generator=generator, dtype=torch.float64)
    entry = torch.full((n,), N_LEVELS - 1)
    return levels, (levels * FL_M).to(dtype), drag.to(dtype), cas.to(dtype), entry


def decode() -> None:
    """Descents a second of the decoder, beside the memory and power bounds of the same arrays, and pyBADA."""
    peer = pybada_descent_s()
    print(f"decoding {N_DESCENTS:,} descents of {N_LEVELS} levels, best of 7 runs")
    head = ("precision", "threads", "plain ms", "decoder ms", "pow ms", "copy ms", "descents/s", "of pow", "of pyBADA")
    print("".join(f"{name:>12}" for name in head))
    for threads in sorted({1, min(2, os.cpu_count() or 1)}):
        torch.set_num_threads(threads)
        for dtype in (torch.float64, torch.float32):
            _decode_row(dtype, threads, peer)
    if peer is None:
        print("pyBADA is not installed: no ratio to it")
    else:
        print(f"pyBADA, FL370-150 at 1,000 ft steps: {peer * 1000:.0f} ms a descent")
    start = "from descentflow.decoder.trajectories import integrate"
    fresh = best_of(lambda: subprocess.run([sys.executable, "-c", start], check=True), repeats=3)
    print(f"fresh process that imports the decoder: {fresh:.2f} s")


def _decode_row(dtype: torch.dtype, threads: int, peer: float | None) -> None:
    a320, (levels, altitude, drag, cas, entry) = aircraft("A320"), profiles(dtype)
    arguments = (a320, levels, altitude, drag, cas, entry)
    out = torch.empty_like(drag)
    with torch.no_grad():
        plain = best_of(lambda: integrate_plain(*arguments))
        fast = best_of(lambda: integrate(*arguments))
        power = best_of(lambda: torch.pow(cas, 3.5, out=out))
        # The decoder reads two arrays and writes four.
        copy = 3 * best_of(lambda: out.copy_(cas))
    rate = N_DESCENTS / fast
    cells = [f"{str(dtype).split('.')[1]:>12}{threads:>12}"]
    cells += [f"{1000 * seconds:>12.1f}" for seconds in (plain, fast, power, copy)]
    cells += [f"{rate:>12,.0f}{fast / power:>12.2f}", f"{'-' if peer is None else f'{rate * peer:,.0f}':>12}"]
    print("".join(cells))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("what", nargs="+", choices=["decode", "prepare"], help="which part of the path")
    parser.add_argument("--rows", type=float, nargs="+", default=[1, 2, 5], help="prepare: sizes in millions of rows")
    args = parser.parse_args()
    for what in args.what:
        {"decode": decode, "prepare": lambda: prepare(args.rows)}[what]()


if __name__ == "__main__":
    main()
