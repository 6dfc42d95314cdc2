"""Measurement of times and memory."""

import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
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
    with tempfile.TemporaryFile() as said:
        return _in_a_small_parent([sys.executable, "-c", code], said)[1] / 2**20


def print_row(cells: list[str], width: int = 12) -> None:
    """One line of a table, right-aligned."""
    print("".join(f"{cell:>{width}}" for cell in cells))


def measured(*words: str) -> tuple[float, float, int]:
    """Wall and CPU seconds, and peak resident bytes, of one descentflow command in a process of its own."""
    start = time.perf_counter()
    with tempfile.TemporaryFile() as said:
        cpu, peak = _in_a_small_parent([sys.executable, "-m", "descentflow.cli.entry", *words], said)
    return time.perf_counter() - start, cpu, peak


_PARENT = """
import json, resource, subprocess, sys
done = subprocess.run(sys.argv[2:])
usage = resource.getrusage(resource.RUSAGE_CHILDREN)
open(sys.argv[1], "w").write(json.dumps([usage.ru_utime + usage.ru_stime, usage.ru_maxrss * 1024]))
sys.exit(done.returncode)
"""


def _in_a_small_parent(command: list[str], said: IO[bytes]) -> tuple[float, int]:
    """CPU seconds and peak bytes of a command.

    A process inherits the peak of the one that starts it, and benchmarks hold much: a small one stands between.
    """
    with tempfile.TemporaryDirectory() as folder:
        usage = Path(folder) / "usage.json"
        # As an installed package has it: compiled once, and not for every command.
        others = {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}
        words = [sys.executable, "-c", _PARENT, str(usage), *command]
        run = subprocess.run(words, stdout=said, stderr=said, env=others)
        if run.returncode:
            said.seek(0)
            raise SystemExit(f"{command} ended with {run.returncode}:\n{said.read().decode()}")
        cpu, peak = json.loads(usage.read_text())
    return cpu, peak
