"""
Plain ADS-B and a weather field to samples
==========================================

Most receivers, and OpenSky's state vectors, have groundspeed and track, and no airspeeds. With the wind and the
temperature of a weather model they are enough: true airspeed is the ground vector less the wind. This tutorial goes
from state vectors and a file as ERA5's to samples.
"""

# %%
# State vectors and a field
# -------------------------
# There is no network here, so the first lines fly A320 in a wind of each day, and write what OpenSky's database and the
# Climate Data Store would serve. The field errs by 2.5 m/s, as ERA5 does. With data of your own, skip to `Prepare`_;
# :doc:`/how-to/sources_of_rows` has the request that fetches ERA5.

from pathlib import Path
from tempfile import TemporaryDirectory

import polars as pl

import descentflow as df

kept = TemporaryDirectory()
folder = Path(kept.name)

world = df.simulate("A320", 300, seed=1, without_airspeeds=True, wind_error_mps=2.5)
seconds = pl.col("timestamp").dt.epoch("us") / 1e6
vectors = world.rows.select(
    time=seconds,
    icao24="icao24",
    lat="latitude",
    lon="longitude",
    velocity=pl.col("groundspeed") * 1852 / 3600,
    heading="track",  # so OpenSky names it
    vertrate=pl.col("vertical_rate") * 0.3048 / 60,
    callsign="callsign",
    onground=False,
    baroaltitude=pl.col("altitude") * 0.3048,
    lastcontact=seconds - 0.3,
)
vectors.write_parquet(folder / "states.parquet")
world.field.to_netcdf(folder / "era5.nc")
types = world.rows.select("icao24", "typecode").unique()
types.write_csv(folder / "icao24_typecode.csv")
print(vectors.head())
print(world.field)

# %%
# Prepare
# -------
# Without the field, there is nothing to learn speeds from, and the error names what is missing.

try:
    df.prepare(folder / "states.parquet", types=folder / "icao24_typecode.csv")
except df.DescentflowError as error:
    print(error)

# %%
# With it, IAS and Mach are derived. What cannot be (turns, stuck groundspeeds, places outside of the field) is
# counted by its cause.

descents = df.prepare(
    folder / "states.parquet", types=folder / "icao24_typecode.csv", airspeeds_from=folder / "era5.nc"
)
print(descents.report)
print(descents.frame["airspeed_source"].value_counts())

# %%
# How far they are off is known here, for the same flights also report their airspeeds.

reported = df.prepare(df.simulate("A320", 300, seed=1))
both = reported.frame.join(descents.frame, on=["icao24", "level_fl", "typecode"], suffix="_derived")
both = both.filter((pl.col("timestamp") - pl.col("timestamp_derived")).abs() < pl.duration(minutes=5))
off = both["IAS_derived"] - both["IAS"]
print(f"derived less reported IAS: {off.mean():+.1f} +- {off.std():.1f} kt")

# %%
# Fit
# ---
# The field's error makes speeds spread more than aircraft do. The fit takes that off, by the size of the error
# that you give, or the published one.

model = df.fit(descents, model="gaussian", wind_error_mps=2.5)
print(model)

# %%
# Sample, and score
# -----------------
# Scored by the same flights' reported airspeeds, which you will hardly have; by the derived ones the call is the same.

samples = df.sample(model, n=1_000, seed=0)
print(samples)
print(df.evaluate(model, reported, n=1_000))

# %%

samples.plot()

# %%
# The same from a shell:
#
# .. code-block:: sh
#
#    descentflow simulate --flights 300 --without-airspeeds --out rows.parquet   # writes rows_field.nc too
#    descentflow prepare rows.parquet --airspeeds-from rows_field.nc --out descents.parquet
#    descentflow fit --model Gaussian --data.descents descents.parquet --data.wind_error_mps 2.5
#    descentflow sample runs/Gaussian/version_0/checkpoints/final.ckpt -n 1000 --seed 0 --out samples.parquet

kept.cleanup()
