"""How times and memory are taken."""

import subprocess
import sys
import time
from collections.abc import Callable


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
