"""Memory that was freed goes back to the system."""

import os
import subprocess
import sys

import pytest

HELD = """
import numpy
from descentflow.core.freed_memory import give_back

def resident():
    return int(next(line for line in open("/proc/self/status") if line.startswith("VmRSS")).split()[1])

numpy.ones(1 << 19)  # once freed, arrays as large come from the heap
arrays = [numpy.ones(1 << 18) for _ in range(200)]
kept = arrays[-1]
del arrays
before = resident()
print(give_back(), before - resident())
"""


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="tells resident memory by /proc")
def test_what_arrays_leave_below_one_that_is_kept_is_given_back() -> None:
    # Dask tells the C library of its workers what to keep, and leaves that in the environment of these tests.
    plain = {name: value for name, value in os.environ.items() if not name.startswith("MALLOC_")}
    done = subprocess.run([sys.executable, "-c", HELD], capture_output=True, text=True, check=True, env=plain)
    given, kilobytes = done.stdout.split()
    if given == "False":
        pytest.skip("this C library gives back by itself")
    assert int(kilobytes) > 300_000  # of 400 MB
