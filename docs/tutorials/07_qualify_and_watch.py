"""
Qualify a simulator, and watch it
=================================

A simulation team is asked two questions. Does the simulator descend as real flights do, within limits? And would anyone
notice if that changed? Here a second world stands for the radar, so that the answers are known.
"""

# %%
# Whether it is inside
# --------------------
#
# The simulator flies A320 with 6 % less drag than the real ones. The limits are those of 14 CFR Part 60 for an idle
# descent.

import descentflow as df

real = df.prepare(df.simulate("A320", 200, seed=1))
flown = df.prepare(df.simulate("A320", 200, seed=2, plant={"drag_polar": {"factor": 0.94}}))
record = df.qualify(real, flown, limits="part60", out="qualified")
print(record)

# %%
# The figure shows each band of 1,000 ft in units of its limit. The page in `qualified` has the rest: where the
# flights come from, what is unsure, the cause, and a line for a signature.

record.plot()

# %%
# The answer "not enough flights" is one: the record has how many more would decide.

table = record.to_polars()
print(table.filter(table["quantity"] == "rate").select("low_fl", "difference", "limit", "verdict", "decides").tail(4))

# %%
# Whether it stays so
# -------------------
#
# Days of flights fill a folder. From the fourteenth on, aircraft have two fifths more drag. A new radar,
# or a change of the simulator's code, would show in the same way.

from descentflow.simulation.days import simulate_days

simulate_days("A320", 300, 18, "days", seed=3, changes={"2024-03-17": {"drag_polar": {"factor": 1.4}}})
watched = df.watch("A320", "days", state="watched", reference_days=8)
print(watched)

# %%
# The state keeps means of days and no flight. The same call on another morning measures what is new.

print(df.watch("A320", "days", state="watched", reference_days=8))
