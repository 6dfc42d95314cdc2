"""The wind by the reports of other aircraft: a check of a diagnosed wind gradient that the diagnosis never saw."""

from dataclasses import dataclass

import numpy as np
import polars as pl
from numpy.typing import NDArray

from descentflow.core.errors import DataError
from descentflow.core.units import FT_M, KT_MPS
from studies.blind_diagnosis.hypsometry import weighted_mean

Array = NDArray[np.float64]
LAYER_FT = 2000.0
MIN_REPORTS = 10
"""A layer with fewer is left out."""
FASTEST_MPS = 100.0
"""A wind beyond this is a register misread."""


def wind_profile(rows: pl.DataFrame, declination_deg: float) -> pl.DataFrame:
    """Median wind by layers of 2,000 ft: groundspeed along the track minus TAS along the heading.

    Args:
        rows: Rows with ``altitude TAS groundspeed track heading``.
        declination_deg: Added to the magnetic heading.

    Returns:
        Columns ``altitude_ft east_mps north_mps reports aircraft``, from the lowest layer up.

    Raises:
        DataError: If fewer than two layers have reports enough.

    Example:
        >>> profile = wind_profile(pl.read_parquet("rows.parquet"), declination_deg=0.0)  # flown in still air
        >>> profile["north_mps"].abs().max() < 2
        True
    """
    known = rows.drop_nulls(["altitude", "TAS", "groundspeed", "track", "heading"])
    track, heading = pl.col("track").radians(), (pl.col("heading") + declination_deg).radians()
    east = (pl.col("groundspeed") * track.sin() - pl.col("TAS") * heading.sin()) * KT_MPS
    north = (pl.col("groundspeed") * track.cos() - pl.col("TAS") * heading.cos()) * KT_MPS
    layer = ((pl.col("altitude") / LAYER_FT).floor() + 0.5) * LAYER_FT
    profile = (
        known.with_columns(east.alias("east_mps"), north.alias("north_mps"), layer.alias("altitude_ft"))
        .filter((pl.col("east_mps") ** 2 + pl.col("north_mps") ** 2).sqrt() < FASTEST_MPS)
        .group_by("altitude_ft")
        .agg(
            pl.col("east_mps", "north_mps").median(),
            pl.len().alias("reports"),
            pl.col("icao24").n_unique().alias("aircraft"),
        )
        .filter(pl.col("reports") >= MIN_REPORTS)
        .sort("altitude_ft")
    )
    if len(profile) < 2:
        raise DataError(
            f"{len(profile)} layers with a wind",
            expected="two or more with TAS, groundspeed, track and heading",
            mend="use rows of more aircraft",
        )
    return profile


@dataclass(frozen=True)
class Gradient:
    """Growth of the tailwind with altitude along the flights' own tracks.

    Attributes:
        mean_per_s: Over the flights, weighted by their levels (m/s per m).
        error_per_s: Standard error, from the scatter between flights.
        by_flight: Columns ``flight_id slope_per_s levels``.

    Example:
        >>> by_flight = pl.DataFrame({"flight_id": ["a", "b"], "slope_per_s": [0.001, 0.003], "levels": [100, 100]})
        >>> found = Gradient(*weighted_mean(by_flight["slope_per_s"].to_numpy(), np.ones(2)), by_flight)
        >>> found.mean_per_s, found.error_per_s
        (0.002, 0.001)
    """

    mean_per_s: float
    error_per_s: float
    by_flight: pl.DataFrame


def tailwind_gradient(frame: pl.DataFrame, profile: pl.DataFrame) -> Gradient:
    """Mean slope of the profile's wind along each flight's track.

    The slope is projected and not the wind: a turn changes the tailwind, but the air gains no speed by it.

    Args:
        frame: Descents with ``level_fl`` and ``track``.
        profile: See :func:`wind_profile`.

    Returns:
        The gradient.

    Raises:
        DataError: If no flight has a track at three levels within the profile.

    Example:
        >>> from descentflow.surveillance.descents.prepared_descents import read_descents
        >>> profile = wind_profile(pl.read_parquet("rows.parquet"), declination_deg=0.0)
        >>> found = tailwind_gradient(read_descents("descents.parquet").frame, profile)
        >>> abs(found.mean_per_s) < 0.001
        True
    """
    layers = profile["altitude_ft"].to_numpy()
    inside = pl.col("level_fl").is_between(layers[0] / 100, layers[-1] / 100)
    found = []
    for flight in frame.drop_nulls("track").filter(inside).partition_by("flight_id", maintain_order=True):
        if len(flight) < 3:
            continue
        altitude = flight["level_fl"].to_numpy() * 100.0
        track = np.radians(flight["track"].to_numpy())
        slopes = (np.gradient(profile[name].to_numpy(), layers * FT_M) for name in ("east_mps", "north_mps"))
        east, north = (np.interp(altitude, layers, slope) for slope in slopes)
        found.append(
            (flight["flight_id"][0], float(np.mean(east * np.sin(track) + north * np.cos(track))), len(flight))
        )
    if not found:
        raise DataError("no flight with a track within the profile", expected="one at least", mend="use other rows")
    table = pl.DataFrame(found, schema=["flight_id", "slope_per_s", "levels"], orient="row")
    mean, error = weighted_mean(table["slope_per_s"].to_numpy(), table["levels"].to_numpy().astype(float))
    return Gradient(mean, error, table)
