"""How times and memory are taken."""

import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from typing import IO


def best_of(work: Callable[[], object], repeats: int = 7) -> float:
    """Shortest wall time of a few runs (s), after one that does not count."""
    work()
    times = []
    for _ in range(repeats):
        start = time.perf_counter()
        work()
        times.append(time.perf_counter() - start)
    return min(times)


def fresh_process_s(arguments: list[str], repeats: int = 3) -> float:
    """Shortest wall time of a Python process with these arguments."""
    return best_of(lambda: subprocess.run([sys.executable, *arguments], check=True, capture_output=True), repeats)


def peak_mib(code: str) -> float:
    """Largest resident memory of a fresh Python process that runs the code."""
    report = "\nimport resource; print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024)"
    done = subprocess.run([sys.executable, "-c", code + report], check=True, capture_output=True, text=True)
    return float(done.stdout.split()[-1])


def print_row(cells: list[str], width: int = 12) -> None:
    """One line of a table, right-aligned."""
    print("".join(f"{cell:>{width}}" for cell in cells))


def measured(*words: str) -> tuple[float, float, int]:
    """Wall and CPU seconds, and peak resident bytes, of one descentflow command in a process of its own."""
    start = time.perf_counter()
    command = [sys.executable, "-m", "descentflow.cli", *words]
    with tempfile.TemporaryFile() as said:
        return _waited(subprocess.Popen(command, stdout=said, stderr=said), said, start)


def _waited(run: "subprocess.Popen[bytes]", said: IO[bytes], start: float) -> tuple[float, float, int]:
    _, status, usage = os.wait4(run.pid, 0)
    wall = time.perf_counter() - start
    run.returncode = os.waitstatus_to_exitcode(status)
    if run.returncode:
        said.seek(0)
        raise SystemExit(f"{run.args} ended with {run.returncode}:\n{said.read().decode()}")
    return wall, usage.ru_utime + usage.ru_stime, usage.ru_maxrss * 1024
