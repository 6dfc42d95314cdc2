"""Rows in turns, and under clearances of a controller: assigned speeds and cleared flight levels."""

from dataclasses import dataclass

import numpy as np
import polars as pl

from descentflow.core.constants import G0_MPS2
from descentflow.core.units import KT_MPS
from descentflow.surveillance.cleaning.filters import Filter, cut, flights_of
from descentflow.surveillance.cleaning.thresholds import Cleaning, Fixed
from descentflow.surveillance.cleaning.windows import clock_of
from descentflow.surveillance.rows.air_data import Array


@dataclass(frozen=True)
class LargestBank(Filter):
    """Drop rows banked by more than a limit, where lift also turns the aircraft and induced drag is larger.

    The bank is the reported roll angle, else that of a coordinated turn, tan(bank) = V rate_of_turn / g, with the
    groundspeed and the change of track between the rows before and after. Rows with neither are kept.

    Args:
        limit_deg: Largest bank.

    Example:
        >>> LargestBank(25.0).keep(pl.DataFrame({"roll": [2.0, -30.0, None]}))["roll"].to_list()
        [2.0, None]
    """

    limit_deg: float
    reason = "banked"

    def keep(self, rows: pl.DataFrame) -> pl.DataFrame:
        """Rows within the limit; a new segment begins after each dropped row."""
        if rows.is_empty():
            return rows
        bank = self.bank_deg(rows)
        return cut(rows, np.nan_to_num(np.abs(bank)) > self.limit_deg)

    @staticmethod
    def bank_deg(rows: pl.DataFrame) -> Array:
        """(n,) bank of every row in degrees, NaN where it is unknown."""
        bank = np.full(len(rows), np.nan)
        if {"track", "groundspeed"} <= set(rows.columns):
            clock = clock_of(flights_of(rows), rows["timestamp"].dt.epoch("us").to_numpy() / 1e6)
            track = rows["track"].cast(pl.Float64).to_numpy()
            change = np.full(len(rows), np.nan)
            change[1:-1] = (track[2:] - track[:-2] + 180.0) % 360.0 - 180.0
            span = np.full(len(rows), np.inf)
            span[1:-1] = clock[2:] - clock[:-2]
            turn = np.where(span <= Fixed.turn_span_s, np.radians(change) / span, np.nan)
            speed = rows["groundspeed"].cast(pl.Float64).to_numpy() * KT_MPS
            bank = np.degrees(np.arctan(speed * turn / G0_MPS2))
        if "roll" in rows.columns:
            reported = rows["roll"].cast(pl.Float64).to_numpy()
            bank = np.where(np.isnan(reported), bank, reported)
        return np.asarray(bank)


@dataclass(frozen=True)
class ClearedSpeed(Filter):
    """Drop rows under an assigned speed, and for a while after it: the speed is not the aircraft's own choice.

    An assigned speed counts from its issue to its end if the aircraft comes within `within_kt` of it in this time
    (0.002 Mach per kt). One that it never comes close to is no constraint: "280 kt or less" is none for an aircraft
    that flies 260. Only sources with clearances know (:data:`~descentflow.surveillance.rows.schema.INSTRUCTIONS`).

    Args:
        after_s: Time after the end of an assigned speed in which rows are dropped, too.
        within_kt: Largest distance from an assigned speed that is flown.

    Example:
        >>> rows = pl.DataFrame({"flight_id": 1, "timestamp": pl.from_epoch(pl.Series([0, 20, 40]))})
        >>> ias, cleared = pl.Series([250.0, 255.0, 270.0]), pl.Series([250.0, None, None])
        >>> rows = rows.with_columns(IAS=ias, cleared_speed_kt=cleared)
        >>> ClearedSpeed(after_s=30.0).keep(rows)["IAS"].to_list()
        [270.0]
    """

    after_s: float
    within_kt: float = Cleaning.cleared_speed_within_kt
    reason = "cleared_speed"

    def keep(self, rows: pl.DataFrame) -> pl.DataFrame:
        """Rows without an assigned speed; a new segment begins after each dropped row."""
        limits = {"cleared_speed_kt": ("IAS", 1.0), "cleared_mach": ("Mach", Fixed.mach_per_kt)}
        known = {name: limit for name, limit in limits.items() if name in rows.columns and rows[name].count()}
        if rows.is_empty() or not known:
            return rows
        flight = flights_of(rows)
        clock = clock_of(flight, rows["timestamp"].dt.epoch("us").to_numpy() / 1e6)
        under = np.zeros(len(rows), dtype=bool)
        for name, (flown, step) in known.items():
            cleared = rows[name].to_numpy()
            # Missing values differ from each other, so each is a run of its own.
            begins = np.flatnonzero((cleared != np.roll(cleared, 1)) | (np.diff(flight, prepend=-1) != 0))
            near = np.abs(rows[flown].to_numpy() - cleared) <= self.within_kt * step
            under |= np.repeat(np.logical_or.reduceat(near, begins), np.diff(begins, append=len(rows)))
        last = np.maximum.accumulate(np.where(under, clock, -np.inf))
        return cut(rows, under | (clock - last <= self.after_s))


@dataclass(frozen=True)
class ClearedLevel(Filter):
    """Drop rows within a height of the cleared flight level: the aircraft may be reducing its rate to capture it.

    A clearance that is replaced before its level is near is no constraint. Level flight itself is dropped without
    clearances, by :class:`~descentflow.surveillance.cleaning.descent_filters.Descending`. Only sources with
    clearances know.

    Args:
        within_ft: Height above and below the cleared level.

    Example:
        >>> rows = pl.DataFrame({"altitude": [30000.0, 24300.0], "cleared_flight_level": [240.0, 240.0]})
        >>> ClearedLevel(within_ft=500.0).keep(rows)["altitude"].to_list()
        [30000.0]
    """

    within_ft: float
    reason = "cleared_level"

    def keep(self, rows: pl.DataFrame) -> pl.DataFrame:
        """Rows further away; a new segment begins after each dropped row."""
        if rows.is_empty() or "cleared_flight_level" not in rows.columns:
            return rows
        above_ft = (rows["altitude"] - 100 * rows["cleared_flight_level"]).cast(pl.Float64).to_numpy()
        return cut(rows, np.abs(above_ft) <= self.within_ft)
