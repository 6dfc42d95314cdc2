"""Waiting of OpenMP's threads: set before torch is first loaded, wherever possible."""

import os
import sys

SPIN = "torch" in sys.modules and not os.environ.keys() & {"OMP_WAIT_POLICY", "OMP_NUM_THREADS"}
"""True if torch was loaded first with the default wait policy: its idle threads then spin and slow other work."""

# Beside other work one descent took 53 ms instead of 8. Whoever sets it themselves keeps what they set.
os.environ.setdefault("OMP_WAIT_POLICY", "PASSIVE")
