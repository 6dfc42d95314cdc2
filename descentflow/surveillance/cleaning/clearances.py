"""Stretches flown otherwise than a free, straight descent: turns, speeds and levels that a controller assigned."""

from dataclasses import dataclass

import numpy as np
import polars as pl

from descentflow.core.constants import G0_MPS2
from descentflow.core.units import KT_MPS
from descentflow.surveillance.cleaning.filters import Filter, cut, flights_of
from descentflow.surveillance.cleaning.windows import clock_of
from descentflow.surveillance.rows.air_data import Array

SPAN_S = 20.0
"""Longest time over which a change of track is taken for one turn."""


@dataclass(frozen=True)
class LargestBank(Filter):
    """Drop rows banked by more than a limit: lift carries the weight and the turn, so induced drag is larger.

    The bank is the reported roll angle, or that of a coordinated turn, tan(bank) = V rate_of_turn / g, with the
    groundspeed and the change of track between the rows before and after. Rows that say neither stay.
    """

    limit_deg: float
    reason = "banked"

    def keep(self, rows: pl.DataFrame) -> pl.DataFrame:
        """Rows within the limit; the stretch changes where one stood."""
        if rows.is_empty():
            return rows
        bank = self.bank_deg(rows)
        return cut(rows, np.nan_to_num(np.abs(bank)) > self.limit_deg)

    @staticmethod
    def bank_deg(rows: pl.DataFrame) -> Array:
        """Bank of every row, NaN where nothing tells it."""
        bank = np.full(len(rows), np.nan)
        if {"track", "groundspeed"} <= set(rows.columns):
            clock = clock_of(flights_of(rows), rows["timestamp"].dt.epoch("us").to_numpy() / 1e6)
            track = rows["track"].cast(pl.Float64).to_numpy()
            change = np.full(len(rows), np.nan)
            change[1:-1] = (track[2:] - track[:-2] + 180.0) % 360.0 - 180.0
            span = np.full(len(rows), np.inf)
            span[1:-1] = clock[2:] - clock[:-2]
            turn = np.where(span <= SPAN_S, np.radians(change) / span, np.nan)
            speed = rows["groundspeed"].cast(pl.Float64).to_numpy() * KT_MPS
            bank = np.degrees(np.arctan(speed * turn / G0_MPS2))
        if "roll" in rows.columns:
            reported = rows["roll"].cast(pl.Float64).to_numpy()
            bank = np.where(np.isnan(reported), bank, reported)
        return np.asarray(bank)


@dataclass(frozen=True)
class ClearedSpeed(Filter):
    """Drop rows flown under a speed instruction, and for a while after it: the speed is not the aircraft's own choice.

    An instruction holds from its issue to its end, if the aircraft comes within `within_kt` of it (0.002 Mach for each
    kt) meanwhile. One that it never comes near is no constraint: "280 kt or less" is none to an aircraft that flies
    260. Only sources with clearances know (:data:`~descentflow.surveillance.rows.schema.INSTRUCTIONS`).
    """

    after_s: float
    within_kt: float = 10.0
    reason = "cleared_speed"

    def keep(self, rows: pl.DataFrame) -> pl.DataFrame:
        """Rows without an instruction; the stretch changes where one stood."""
        limits = {"cleared_speed_kt": ("IAS", 1.0), "cleared_mach": ("Mach", 0.002)}
        known = {name: limit for name, limit in limits.items() if name in rows.columns and rows[name].count()}
        if rows.is_empty() or not known:
            return rows
        flight = flights_of(rows)
        clock = clock_of(flight, rows["timestamp"].dt.epoch("us").to_numpy() / 1e6)
        under = np.zeros(len(rows), dtype=bool)
        for name, (flown, step) in known.items():
            cleared = rows[name].to_numpy()
            # Missing values differ from each other, and so stand alone.
            begins = np.flatnonzero((cleared != np.roll(cleared, 1)) | (np.diff(flight, prepend=-1) != 0))
            near = np.abs(rows[flown].to_numpy() - cleared) <= self.within_kt * step
            under |= np.repeat(np.logical_or.reduceat(near, begins), np.diff(begins, append=len(rows)))
        last = np.maximum.accumulate(np.where(under, clock, -np.inf))
        return cut(rows, under | (clock - last <= self.after_s))


@dataclass(frozen=True)
class ClearedLevel(Filter):
    """Drop rows within a height of the level that is cleared: the aircraft may be taking its rate off to capture it.

    A level that is cleared further before it is near is no constraint. What is level goes without clearances, by
    :class:`~descentflow.surveillance.cleaning.filters.Descending`. Only sources with clearances know.
    """

    within_ft: float
    reason = "cleared_level"

    def keep(self, rows: pl.DataFrame) -> pl.DataFrame:
        """Rows further away; the stretch changes where one stood."""
        if rows.is_empty() or "cleared_flight_level" not in rows.columns:
            return rows
        above_ft = (rows["altitude"] - 100 * rows["cleared_flight_level"]).cast(pl.Float64).to_numpy()
        return cut(rows, np.abs(above_ft) <= self.within_ft)
