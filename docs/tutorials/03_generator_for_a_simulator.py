"""
A generator for a simulator
===========================

A simulator of traffic needs descents that differ as real ones do: many, fast, reproducible, for given conditions.
This tutorial fits a generator that is given the air temperature, and draws from it what a simulator takes.
"""

# %%
# A model with a context
# ----------------------
# 400 flights of a simulated fleet, in air that is warmer or colder from flight to flight. The deviation of the
# temperature is known of each flight: a table by ``flight_id``.

from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

import polars as pl
import torch

import descentflow as df

kept = TemporaryDirectory()
folder = Path(kept.name)


def weather(flights):
    """Give every flight a temperature deviation of its own, drawn by its number."""
    deviation = [
        10.0 * float(torch.randn((), generator=torch.Generator().manual_seed(k))) for k in flights.number.tolist()
    ]
    return replace(flights, deviation_k=torch.tensor(deviation, dtype=flights.deviation_k.dtype))


world = df.simulate("A320", 400, seed=3, inject=weather)
descents = df.prepare(world.rows, typecode="A320")
table = folder / "weather.csv"
world.flights.select("flight_id", "deviation_k").write_csv(table)

model = df.fit(descents, model="gaussian", context=["deviation_k"], context_table=table, out=folder / "a320.ckpt")
print(model)

# %%
# Draw for given conditions
# -------------------------
# The same seed gives the same descents on one machine with the same versions, elsewhere the same but for last digits.
# ``model`` may be the checkpoint's path: reading one executes no code.

cold = df.sample(folder / "a320.ckpt", 500, seed=0, context={"deviation_k": -15.0}, entry_fl=350)
warm = df.sample(folder / "a320.ckpt", 500, seed=0, context={"deviation_k": 15.0}, entry_fl=350)
print(cold)
print(warm)

# %%

import matplotlib.pyplot as plt

figure, axes = plt.subplots(figsize=(6, 4))
for samples, colour, name in ((cold, "tab:blue", "ISA - 15 K"), (warm, "tab:red", "ISA + 15 K")):
    last = samples.to_polars().group_by("sample_id").agg(pl.col("time_s").max())
    axes.hist(last["time_s"] / 60, bins=30, alpha=0.6, color=colour, label=name)
axes.set(xlabel="minutes from FL350 to the lowest level", ylabel="samples")
axes.legend()

# %%
# Into the simulator
# ------------------
# A table of one line for each sample and level, or Parquet, CSV and NetCDF files by ``samples.write(path)``. TAS,
# groundspeed and distances are those of the temperature that was given:

print(warm.to_polars().head())

# %%
# Loops over many batches are faster with arrays than with tables: the decoder flies a batch of weights at once, and with
# ``out=`` writes into the arrays of the last batch. These are draws before rejection, with the TAS of standard air.
# ``python scripts/benchmark.py decode`` prints the speed on your machine.

density = df.load(folder / "a320.ckpt")
decoder, context = density.representation.decoder, density.representation.context
ten_degrees = context.encode(pl.DataFrame({"deviation_k": [10.0]}))
flown = None
for batch in range(3):
    weights = density.sample(10_000, seed=batch, context=ten_degrees)
    flown = decoder(weights, out=flown)
    minutes = flown.time_s[:, 0] / 60
    print(f"batch {batch}: {minutes.mean():.2f} min on average from FL{decoder.levels_fl[-1]:.0f}")

# %%
# A descent that has begun
# ------------------------
# :func:`~descentflow.generation.prediction.predict.predict` continues flights that were seen down to some level:
# intervals of the time to each level below.

unconditional = df.fit(descents, model="gaussian")
prediction = df.predict(unconditional, descents, from_fl=290)
print(prediction)

kept.cleanup()
