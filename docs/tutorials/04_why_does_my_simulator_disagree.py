"""
Why does my simulator disagree?
===============================

Flights from the radar and flights of a simulator are not alike. This tutorial makes such a case, of which the truth
is known, and asks where they differ, which unmodelled effect causes it, and how far the gap shrinks once the effect
is in the simulator.
"""

# %%
# The case
# --------
# The simulator is a model that was trained on flights in standard air. The real flights fly in air that is 12 K
# warmer, which the simulator does not know.

from pathlib import Path
from tempfile import TemporaryDirectory

import descentflow as df

kept = TemporaryDirectory()
folder = Path(kept.name)

a320 = df.aircraft("A320")
model = df.fit(df.prepare(df.simulate(a320, 400, seed=0).rows), model="gaussian")
warmer = {"temperature": {"deviation_k": 12.0}}  # `descentflow simulate --plant` does the same
real = df.prepare(df.simulate(a320, 400, seed=1, plant=warmer).rows)

# %%
# The diagnosis
# -------------
# Rows, prepared descents or a file of either; and a model, a checkpoint, or a type for nominal BADA.

report = df.diagnose(real, model, out=folder / "gap")
print(report)

# %%
# What it costs, before and with the cause in the simulator, and where: each quantity in bands of altitude.

from descentflow.diagnosis.report.figures import cost_figure, level_figure

figure = cost_figure(report.costs, "time")

# %%

figure = level_figure("rate", report.details.curves["rate"], report.details.profile)

# %%
# Its parts are typed, for programs. The effect, its size with a 90 % interval, and how much of the gap it closes:

for cause in report.causes:
    print(cause.effect, [size.text for size in cause.sizes], cause.closure.marginal)

# %%
# ``gap.html`` is the page to read, ``gap.json`` the same for programs, ``corrected.ckpt`` the simulator with the
# effect added.

print(sorted(path.name for path in (folder / "gap").iterdir()))

# %%
# How far the gap shrinks
# -----------------------
# The corrected simulator is sampled and scored like any other model. To diagnose it, diagnose what it flies:
# ``corrected.parquet`` next to it, or samples.

before = df.evaluate(model, real, n=1_000)
after = df.evaluate(folder / "gap" / "corrected.ckpt", real, n=1_000)
print("simulator as it was\n", before)
print("with the effect\n", after)

# %%
# Read it with care
# -----------------
# **A gap that closes does not prove the cause.** Without true airspeed, warm air and a handful of other effects
# change the rate nearly alike, and the answer is a group. (Where the air differs between flights as well,
# there may be no answer without true airspeed: it alone measures the air of each flight.)

blind = df.diagnose(real, model, channels=["IAS", "Mach", "vertical_rate"])
print(blind)

# %%
# :doc:`/explanation/diagnosis` explains the statistics.

kept.cleanup()
