"""Descents a second of the decoder, against the memory and power bounds of the same arrays, BADA 4, and pyBADA."""

import argparse
import importlib.util
import os
import subprocess
import sys
import tempfile
import time
import warnings
from pathlib import Path

import torch
from torch import Tensor

from benchmarks.timing import best_of, fresh_process_s, peak_mib, print_row
from descentflow.aircraft_types.registry import aircraft
from descentflow.core.units import FL_M
from descentflow.representation.decoder.trajectories import integrate

N_DESCENTS, N_LEVELS = 10_000, 228
GPU_DESCENTS, GPU_CHUNK = 10_000_000, 250_000


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the part's options."""
    parser.add_argument("--checkpoint", type=Path, help="for the first descent; without it a small model is fitted")


def run(args: argparse.Namespace) -> None:
    """Print the tables."""
    peer = pybada_descent_s()
    print(f"decoding {N_DESCENTS:,} descents of {N_LEVELS} levels, best of 7 runs, into arrays of an earlier batch")
    head = ["precision", "threads", "new ms", "decoder ms", "pow ms", "copy ms"]
    print_row([*head, "descents/s", "of pow", "of pyBADA"])
    for threads in sorted({1, min(2, os.cpu_count() or 1)}):
        torch.set_num_threads(threads)
        for dtype in (torch.float64, torch.float32):
            _cpu_row(dtype, threads, peer)
    print("'new' makes new arrays; 'copy' moves as many values as the decoder reads and writes")
    if peer is None:
        print("pyBADA is not installed: no ratio to it")
    else:
        print(f"pyBADA, FL370-150 at 1,000 ft steps: {peer * 1000:.0f} ms a descent")
        _bada4()
    _memory()
    _first_descent(args.checkpoint)
    if torch.cuda.is_available():
        _gpu()
    else:
        print("no GPU here: its table is left out")


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


def _bada4() -> None:
    """Processor time of pyBADA's dummies of BADA 4 over that of BADA 3, one thread, in turns."""
    spec = importlib.util.find_spec("pyBADA")
    folder = Path(str(spec.origin if spec else "")).parent / "aircraft" / "BADA4"
    types = {kind: aircraft(f"Dummy-{kind}", folder) for kind in ("TWIN", "TBP", "PST")}
    torch.set_num_threads(1)
    print("BADA 4 over BADA 3, processor time of one thread in turns")
    print_row(["precision", "BADA 3 ms", *(str(kind.engine) for kind in types.values())])
    for dtype in (torch.float64, torch.float32):
        arguments, best = profiles(dtype), dict.fromkeys(("BADA 3", *types), float("inf"))
        arrays = {kind: integrate(aircraft("A320"), *arguments) for kind in best}
        for _ in range(7):
            for kind in best:
                started = time.process_time()
                integrate(types.get(kind) or aircraft("A320"), *arguments, out=arrays[kind])
                best[kind] = min(best[kind], time.process_time() - started)
        base = best.pop("BADA 3")
        ratios = (f"{ms / base:.2f}" for ms in best.values())
        print_row([str(dtype).split(".")[1], f"{1000 * base:.1f}", *ratios])


def profiles(
    dtype: torch.dtype, n: int = N_DESCENTS, device: str = "cpu"
) -> tuple[Tensor, Tensor, Tensor, Tensor, Tensor]:
    """Levels, altitudes, drag, CAS and entries of n plausible descents."""
    generator = torch.Generator(device).manual_seed(0)
    levels = torch.arange(150, 150 + N_LEVELS, dtype=torch.float64, device=device)

    def around(middle: float, spread: float) -> Tensor:
        return middle + spread * torch.randn(n, N_LEVELS, generator=generator, dtype=dtype, device=device)

    entry = torch.full((n,), N_LEVELS - 1, device=device)
    return levels, (levels * FL_M).to(dtype), around(40_000, 1_000), around(140, 2), entry


def _cpu_row(dtype: torch.dtype, threads: int, peer: float | None) -> None:
    arguments = (aircraft("A320"), *profiles(dtype))
    cas = arguments[4]
    out, earlier = torch.empty_like(cas), integrate(*arguments)
    with torch.no_grad():
        fresh = best_of(lambda: integrate(*arguments))
        eager = best_of(lambda: integrate(*arguments, out=earlier))
        power = best_of(lambda: torch.pow(cas, 3.5, out=out))
        # The decoder reads two arrays and writes four.
        copy = 3 * best_of(lambda: out.copy_(cas))
    rate = N_DESCENTS / eager
    cells = [str(dtype).split(".")[1], str(threads)]
    cells += [f"{1000 * seconds:.1f}" for seconds in (fresh, eager, power, copy)]
    print_row([*cells, f"{rate:,.0f}", f"{eager / power:.2f}", "-" if peer is None else f"{rate * peer:,.0f}"])


_CHUNKED = """
import sys; sys.path[:0] = {path!r}
import torch; torch.set_num_threads(1)
from benchmarks.decode import profiles
from descentflow.representation.decoder.trajectories import integrate
from descentflow.aircraft_types.registry import aircraft
levels, altitude, drag, cas, entry = profiles(torch.float64, 10_000)
flown = None
for _ in range({chunks}):
    flown = integrate(aircraft("A320"), levels, altitude, drag, cas, entry, out=flown)
"""


def _memory() -> None:
    """Peak memory of one process that decodes one and twenty chunks."""
    path = [str(Path(__file__).parent.parent)]
    once, twenty = (peak_mib(_CHUNKED.format(path=path, chunks=chunks)) for chunks in (1, 20))
    print(f"peak memory: 10,000 descents {once:.0f} MiB, 200,000 in chunks of 10,000 {twenty:.0f} MiB")


def _first_descent(checkpoint: Path | None) -> None:
    """Time of `descentflow sample -n 1` in a fresh process."""
    bare = fresh_process_s(["-c", "from descentflow.representation.decoder.trajectories import integrate"])
    print(f"fresh process that imports the decoder: {bare:.2f} s")
    with tempfile.TemporaryDirectory() as folder:
        if checkpoint is None:
            checkpoint = _small_model(Path(folder))
        command = [
            "-m",
            "descentflow.cli.entry",
            "sample",
            str(checkpoint),
            "-n",
            "1",
            "--out",
            f"{folder}/one.parquet",
        ]
        print(f"first descent from a checkpoint in a fresh process: {fresh_process_s(command):.2f} s")


def _small_model(folder: Path) -> Path:
    for words in (
        "simulate --typecode A320 --flights 150 --out rows.parquet",
        "prepare rows.parquet --out descents.parquet",
        "fit --model Gaussian --data.descents descents.parquet",
    ):
        command = [sys.executable, "-m", "descentflow.cli.entry", *words.split()]
        subprocess.run(command, check=True, capture_output=True, cwd=folder)
    return next(folder.rglob("best.ckpt"))


def _gpu() -> None:
    """Up to ten million descents in chunks, against the time that the memory's bandwidth needs for their values."""
    print(f"{torch.cuda.get_device_name()}: chunks of {GPU_CHUNK:,} descents, input made once")
    print_row(["precision", "descents", "decoder s", "copy s", "descents/s", "of copy", "peak GiB"])
    for dtype in (torch.float64, torch.float32):
        arguments = (aircraft("A320"), *profiles(dtype, GPU_CHUNK, "cuda"))
        for n in (GPU_DESCENTS // 10, GPU_DESCENTS):
            _gpu_row(arguments, n)


def _gpu_row(arguments: tuple[object, ...], n: int) -> None:
    cas = arguments[4]
    assert isinstance(cas, Tensor)
    flown, copied = integrate(*arguments), torch.empty_like(cas)
    torch.cuda.reset_peak_memory_stats()

    def chunks(work: object) -> float:
        def all_chunks() -> None:
            for _ in range(n // GPU_CHUNK):
                work()
            torch.cuda.synchronize()

        return best_of(all_chunks, repeats=3)

    eager = chunks(lambda: integrate(*arguments, out=flown))
    copy = 3 * chunks(lambda: copied.copy_(cas))
    cells = [str(cas.dtype).split(".")[1], f"{n:,}", f"{eager:.3f}", f"{copy:.3f}"]
    peak = torch.cuda.max_memory_allocated() / 2**30
    print_row([*cells, f"{n / eager:,.0f}", f"{eager / copy:.2f}", f"{peak:.1f}"])
