"""
Qualify a simulator
===================

A simulation team is asked whether its simulator descends as real flights do, and somebody has to sign the answer.
Here a second world stands for the radar, so that the answer is known.
"""

# %%
# Whether it is inside
# --------------------
#
# The simulator flies A320 with 6 % less drag than the real ones. The limits are those of 14 CFR Part 60 for an idle
# descent.

from pathlib import Path
from tempfile import TemporaryDirectory

import descentflow as df

kept = TemporaryDirectory()
folder = Path(kept.name)
real = df.prepare(df.simulate("A320", 200, seed=1))
flown = df.prepare(df.simulate("A320", 200, seed=2, plant={"drag_polar": {"factor": 0.94}}))
record = df.qualify(real, flown, limits="part60", simulator_name="our simulator", out=folder / "qualified")
print(record)

# %%
# The figure shows each band of 1,000 ft in units of its limit. The page `qualified/qualification.html` has the rest:
# where the flights come from, what is unsure, the cause, and a line for a signature.

record.plot()

# %%
# The answer "not enough flights" is one: the record has how many more would decide.

table = record.to_polars()
print(table.filter(table["quantity"] == "rate").select("low_fl", "difference", "limit", "verdict", "decides").tail(4))

# %%
# After the repair
# ----------------
#
# The column `corrected` has the difference that is left once the causes that were found are in the simulator: whether
# the repair is worth its cost, before anybody makes it.

print(table.filter(table["corrected"].is_not_null()).select("quantity", "low_fl", "difference", "corrected").tail(4))

# %%
# Limits of your own
# ------------------
#
# An acceptance test is a file with limits by quantity and level, and the errors of a prediction may have limits, too:
# here of the altitude five minutes ahead.

limits = folder / "ours.yaml"
limits.write_text("""
source: acceptance test 7
limits:
  - {quantity: rate, absolute: 300, levels: [100, 240]}
  - {quantity: altitude_ahead, minutes: 5, absolute: 800}
""")
ours = df.qualify(real, flown, limits=limits, simulator_name="our simulator")
print(ours)
