"""The cleaning of `descentflow prepare` as a user of pandas writes it: flight by flight."""

import numpy as np
import pandas as pd

from descentflow.core.units import FPM_MPS, KT_MPS
from descentflow.surveillance.cleaning.rates import ConstantRate
from descentflow.surveillance.cleaning.thresholds import Cleaning
from descentflow.surveillance.rows.air_data import cas_of_mach_kt, isa_tas_of_mach_kt
from descentflow.surveillance.rows.schema import CHANNELS, POSSIBLE, REQUIRED

RULES = Cleaning()
SPIKES = (("altitude", RULES.spike_altitude_ft), ("IAS", RULES.spike_ias_kt), ("Mach", RULES.spike_mach))


def prepare_pandas(rows: pd.DataFrame) -> pd.DataFrame:
    """Levels of the free descents of all flights."""
    rows = rows.dropna(subset=list(REQUIRED))
    for name, (low, high) in POSSIBLE.items():
        if name in REQUIRED:
            rows = rows[rows[name].between(low, high)]
    rows = rows.sort_values(["flight_id", "timestamp"]).drop_duplicates(["icao24", "timestamp"])
    parts = [_levels(_free(flight)) for _, flight in rows.groupby("flight_id", sort=True)]
    return pd.concat([part for part in parts if len(part) >= RULES.fewest_levels])


def _free(rows: pd.DataFrame) -> pd.DataFrame:
    for name, floor in SPIKES:
        rows = rows[~_spikes(rows[name], floor)]
    rows = rows[(rows["IAS"] - cas_of_mach_kt(rows["Mach"].values, rows["altitude"].values)).abs() <= 25.0]
    rows = rows[~_spikes(rows["vertical_rate"], RULES.spike_rate_fpm)]
    seconds = (rows["timestamp"] - rows["timestamp"].iloc[0]).dt.total_seconds()
    descends = rows["vertical_rate"] <= -RULES.slowest_fpm
    since = seconds - seconds.where(~descends).ffill()
    until = seconds.where(~descends).bfill() - seconds
    rows = rows.assign(stretch=(~descends).cumsum(), seconds=seconds)
    steady = ~(since < RULES.transient_s) & ~(until < RULES.transient_s)
    rows = rows[descends & steady]
    if rows.empty:
        return rows
    # pandas has no such rule: descentflow's own, on one flight.
    tas_fpm = isa_tas_of_mach_kt(rows["Mach"].values, rows["altitude"].values) * KT_MPS / FPM_MPS
    held = ConstantRate().is_constant(
        np.zeros(len(rows), dtype=np.int64), rows["seconds"].to_numpy(), rows["vertical_rate"].to_numpy(), tas_fpm
    )
    rows = rows.assign(stretch=rows["stretch"] + np.cumsum(held))[~held]
    rows = rows.assign(descent=(rows["altitude"].diff() > RULES.climb_back_ft).cumsum())
    if rows["descent"].nunique() > 1:
        spans = rows.groupby("descent")["altitude"].agg(lambda a: a.max() - a.min())
        rows = rows[rows["descent"] == spans.idxmax()]
    return rows[rows["altitude"] < rows["altitude"].cummin().shift(fill_value=np.inf)]


def _spikes(values: pd.Series, floor: float) -> pd.Series:
    median = values.rolling(5, center=True, min_periods=3).median()
    off = (values - median).abs()
    mad = off.rolling(5, center=True, min_periods=3).median()
    # Without the ends of a flight, where there is no middle.
    spike = (off > floor) & (off > 3 * 1.4826 * mad)
    spike.iloc[:2] = spike.iloc[-2:] = False
    return spike


def _levels(rows: pd.DataFrame) -> pd.DataFrame:
    parts = []
    channels = [name for name in CHANNELS if name in rows.columns]
    for _, part in rows.groupby("stretch"):
        altitude = part["altitude"].to_numpy() / 100
        wide = (part["seconds"].diff() > RULES.longest_gap_s) | (part["altitude"].diff() < -RULES.highest_gap_ft)
        for _, run in part.groupby(wide.cumsum()):
            altitude = run["altitude"].to_numpy() / 100
            levels = np.arange(np.floor(altitude[0]), max(np.ceil(altitude[-1]), RULES.bottom_fl) - 1, -1.0)
            columns = {name: np.interp(-levels, -altitude, run[name].to_numpy()) for name in ("seconds", *channels)}
            parts.append(pd.DataFrame({"level_fl": levels, **columns}))
    table = pd.concat(parts) if parts else pd.DataFrame({"level_fl": []})
    return table.assign(flight_id=rows["flight_id"].iloc[0] if len(rows) else "")
