"""
An in-house radar feed and a BADA licence
=========================================

A provider's radar feed is a table with column names and units of its own, and the provider holds a BADA 4 licence.
Both are a few lines: rename and convert the columns once, and name the folder of BADA's files.
"""

# %%
# A feed of your own
# ------------------
# This one has metres, metres per second and seconds since 1970, as many in-house feeds do.

from pathlib import Path
from tempfile import TemporaryDirectory

import polars as pl

import descentflow as df

kept = TemporaryDirectory()
folder = Path(kept.name)

feed = df.simulate("A320", 300, seed=2).rows.select(
    pl.col("timestamp").dt.epoch("ms").truediv(1000).alias("time_of_track"),
    pl.col("icao24").alias("mode_s_address"),
    pl.col("typecode").alias("aircraft_type"),
    pl.col("altitude").mul(0.3048).alias("flight_level_m"),
    pl.col("vertical_rate").mul(0.3048 / 60).alias("rocd_mps"),
    pl.col("IAS").mul(1852 / 3600).alias("ias_mps"),
    pl.col("Mach").alias("mach_number"),
)
feed.write_csv(folder / "feed.csv")
print(feed.head())

# %%
# Rows are in ft, kt and ft/min and have the names of :data:`~descentflow.surveillance.rows.schema.COLUMNS`. Pass
# the table itself; no file is needed in between.

rows = pl.read_csv(folder / "feed.csv").select(
    pl.col("time_of_track").mul(1e6).cast(pl.Int64).cast(pl.Datetime("us", "UTC")).alias("timestamp"),
    pl.col("mode_s_address").alias("icao24"),
    pl.col("aircraft_type").alias("typecode"),
    pl.col("flight_level_m").truediv(0.3048).alias("altitude"),
    pl.col("rocd_mps").truediv(0.3048 / 60).alias("vertical_rate"),
    pl.col("ias_mps").truediv(1852 / 3600).alias("IAS"),
    pl.col("mach_number").alias("Mach"),
)
descents = df.prepare(rows, typecode="A320")
print(descents.report)

# %%
# The same in one call, or from a shell: a column with its factor. Names of the trade (``mode_s_address``,
# ``mach_number``, ``ROCD``, ``FL``) are known. ``descentflow prepare feed.csv --column 'altitude=flight_level_m*3.28084'``
# does so, and ``diagnose`` takes ``--column`` too. For ``evaluate`` and ``predict-descent`` prepare first.

columns = {
    "timestamp": "time_of_track",
    "altitude": "flight_level_m*3.28084",
    "vertical_rate": "rocd_mps*196.850",
    "IAS": "ias_mps*1.94384",
}
print(df.prepare(folder / "feed.csv", typecode="A320", columns=columns).flights)

# %%
# Had the units been forgotten, physics would have noticed: at a Mach number and an altitude there is one airspeed.

try:
    df.prepare(rows.with_columns(pl.col("IAS") * 1852 / 3600), typecode="A320")
except df.DescentflowError as error:
    print(error)

# %%
# A BADA licence
# --------------
# EUROCONTROL ships BADA 4 as a folder with an XML file for each aircraft model, and descentflow reads it as it is. No
# licensed file can be shown here. These lines take EUROCONTROL's dummy aircraft, which come with its library pyBADA;
# you name your own folder.

import pyBADA

bada = Path(pyBADA.__file__).parent / "aircraft" / "BADA4"
try:
    df.aircraft("DUM2", bada_dir=bada)
except df.DescentflowError as error:
    print(error)

# %%
# Two models have this designator, so one of them is named. From here on its coefficients infer the drag and fly it
# again. BADA 3 works alike, see :doc:`/how-to/bada`.

licensed = df.aircraft("Dummy-TWIN", bada_dir=bada)
print(licensed)
model = df.fit(descents, model="gaussian", bada_dir=bada, aircraft="Dummy-TWIN")
print(model)

# %%
# Its engines brake at idle, and burn fuel all the same:

import torch

altitude_m, tas_mps = torch.tensor([3048.0, 6096.0, 9144.0]), torch.tensor([175.0, 205.0, 235.0])
print("idle thrust, kN:", licensed.idle_thrust_n(altitude_m, tas_mps) / 1000)
print("fuel flow, kg/min:", licensed.idle_fuel_flow_kg_s(altitude_m, tas_mps) * 60)

# %%
# A nominal descent by these coefficients, next to samples:

import matplotlib.pyplot as plt

from descentflow.physics.nominal_descent import nominal_descent

samples = df.sample(model, n=200, seed=0).to_polars()
levels = samples["level_fl"].unique().sort()
nominal = nominal_descent(licensed, levels.to_torch().double())
figure, axes = plt.subplots(figsize=(6, 4))
for (_,), one in samples.group_by("sample_id"):
    axes.plot(one["vertical_rate"], one["level_fl"], color="tab:blue", alpha=0.06, linewidth=1)
axes.plot(nominal.rate_mps / 0.3048 * 60, levels, color="black", label="nominal BADA")
axes.set(xlabel="rate of descent, ft/min", ylabel="flight level")
axes.legend()

# %%
# The same from a shell:
#
# .. code-block:: sh
#
#    descentflow prepare feed_in_ft_and_kt.csv --typecode A320 --out descents.parquet
#    descentflow fit --model Gaussian --data.descents descents.parquet --data.bada_dir bada/ --data.aircraft A320-231
#    descentflow simulate --typecode A320-231 --flights 100 --bada-dir bada/ --out rows.parquet
#
# The coefficients are kept in the checkpoint: treat it as the licence tells you to treat them.

kept.cleanup()
