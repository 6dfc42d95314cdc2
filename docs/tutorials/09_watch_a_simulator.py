"""
Watch a simulator day by day
============================

A simulator that was right in spring may be wrong in autumn: a new version of its code, a fleet with other engines,
another radar. `watch` measures each day of flights, and names the day on which the difference changed, how large the
change is, and why. Here a simulated fleet stands for the real one, so that the day is known.
"""

# %%
# Days that fill a folder
# -----------------------
#
# From the fourteenth day on, aircraft have two fifths more drag.

from pathlib import Path
from shutil import copy
from tempfile import TemporaryDirectory

import descentflow as df
from descentflow.simulation.days import simulate_days

kept = TemporaryDirectory()
folder = Path(kept.name)
changes = {"2024-03-17": {"drag_polar": {"factor": 1.4}}}
files = simulate_days("A320", 300, 18, folder / "all_days", seed=3, changes=changes)

# %%
# In a folder of a radar they come one after the other. The first eight that can be used are the reference: there the
# scatter between days is learnt, and no change is sought. A day of four flights is not enough, and is left out
# by name.

days, state = folder / "days", folder / "watched"
days.mkdir()
for path in files[:8]:
    copy(path, days)
print(df.watch("A320", days, state=state, reference_days=8))

# %%
# Three more days are measured when the call comes again. Those that are known are not read.

for path in files[8:11]:
    copy(path, days)
quiet = df.watch("A320", days, state=state, reference_days=8)
print(quiet)
print(quiet.new_days)

# %%
# The change
# ----------
#
# With the rest of the days there is an alarm: a day with its interval, the size, and the cause, which is the diagnosis
# of the flights since then against those before.

for path in files[11:]:
    copy(path, days)
changed = df.watch("A320", days, state=state, reference_days=8)
print(changed)
print(changed.alarm["change"])

# %%
# The evidence grew with each day that spoke for a change. The alarm is where its logarithm passes that of one over the
# false alarms that are allowed in a year, 5 % here.

for day in changed.new_days:
    print(day["day"], day["flights"], day["log_e"], day["alarm"])

# %%
# `watched/watch.html` shows the days, the evidence and the change, and how large a step must be to be seen within a
# week. The state keeps means of days, and no flight:

print(changed.days.select("day", "flights", "rate: mean", "rate: variance").tail(3))

# %%
# When the change is known and meant, `accept` makes the days from it on the new reference.

print(df.watch("A320", days, state=state, reference_days=8, accept=True))
