"""
Your receiver's history to a model
==================================

A receiver that runs readsb, tar1090 or an aggregator's feeder keeps a *trace* of every aircraft: files
``trace_full_*.json`` in a tree of folders, or published archives of such trees. This tutorial goes from the traces
of one type to a generator of its descents.
"""

# %%
# Traces
# ------
# There is no receiver here, so the first lines write what one would have kept: traces of simulated A320. You have
# yours already; skip to `Prepare`_.

import gzip
import json
from pathlib import Path
from tempfile import TemporaryDirectory

import polars as pl

import descentflow as df

kept = TemporaryDirectory()
folder = Path(kept.name)


def trace_of(flight: pl.DataFrame) -> dict[str, object]:
    """The trace of one aircraft as readsb writes it: a list for each point, with details every fourth point."""
    begin = flight["timestamp"][0].timestamp()
    points = []
    for number, row in enumerate(flight.iter_rows(named=True)):
        details = {"flight": row["callsign"], "mach": round(row["Mach"], 3), "type": "adsb_icao"}
        seconds, rate = row["timestamp"].timestamp() - begin, round(row["vertical_rate"])
        point = [round(seconds, 2), 52.0, 4.0, round(row["altitude"]), None, None, 0, rate]
        points.append([*point, None if number % 4 else details, "adsb_icao", None, None, round(row["IAS"]), None])
    return {"icao": flight["icao24"][0], "t": flight["typecode"][0], "timestamp": begin, "trace": points}


rows = df.simulate("A320", 300, seed=1).rows.drop_nulls(["altitude", "IAS", "Mach", "vertical_rate"])
for (day, address), flights in rows.group_by(pl.col("timestamp").dt.date(), "icao24"):
    place = folder / "traces" / f"{day}" / str(address)[-2:]
    place.mkdir(parents=True, exist_ok=True)
    trace = gzip.compress(json.dumps(trace_of(flights.sort("timestamp"))).encode())
    (place / f"trace_full_{address}.json").write_bytes(trace)
print(len(list(folder.rglob("trace_full_*.json"))), "traces")

# %%
# Prepare
# -------
# :func:`~descentflow.surveillance.prepare.prepare` takes the whole tree, knows the format by its content, and keeps
# what is free descent. Its report accounts for everything else. ``shown`` keeps the dropped rows of a few flights,
# to look at.

descents = df.prepare(folder / "traces", typecode="A320", shown=3)
print(descents.report)

# %%
# Look at what each rule dropped before you trust a threshold (:doc:`/how-to/cleaning` has them all).

from descentflow.surveillance.figure_pages import cleaning_figure

shown = descents.dropped_rows.partition_by("flight_id", maintain_order=True)
figure = cleaning_figure(shown)

# %%
# Fit
# ---
# The Gaussian is fitted in closed form. ``"mixture"`` and ``"flow"`` are the other densities
# (:doc:`/how-to/densities`); with few flights, begin here. A fifth of the flights is held out
# to score it, then the model is fitted again to all.

model = df.fit(descents, model="gaussian", out=folder / "a320.ckpt")
print(model)

# %%
# Sample, and score
# -----------------
# Samples descend from the levels at which flights did; what lies beyond what flights did there by more than a margin is
# drawn again.

samples = df.sample(model, n=1_000, seed=0)
print(samples)
print(samples.to_polars().head())

# %%
# Each score stands next to its noise floor, the distance between two sets of the held-out flights: a perfect
# generator has ``equal_size`` at the floor.

scores = df.evaluate(model, descents, n=1_000)
print(scores)

# %%

figure = scores.figures()["profiles"]

# %%
# The same from a shell:
#
# .. code-block:: sh
#
#    descentflow prepare traces/ --typecode A320 --figures look --out descents.parquet
#    descentflow fit --model Gaussian --data.descents descents.parquet
#    descentflow sample runs/Gaussian/version_0/checkpoints/final.ckpt -n 1000 --seed 0 --out samples.parquet
#    descentflow evaluate runs/Gaussian/version_0/checkpoints/final.ckpt --real descents.parquet --out evaluation

kept.cleanup()
