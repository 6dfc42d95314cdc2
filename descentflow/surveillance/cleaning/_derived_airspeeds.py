r"""Airspeeds of rows that report none: the ground vector less the wind, in air of a known temperature and pressure.

.. math:: V^2 = |\mathbf V_g - \mathbf W|^2 + \dot h^2, \qquad M = V / \sqrt{\kappa R T},

and CAS of the Mach number and pressure altitude. Rows that report airspeeds keep them. Those of which nothing can be
derived are dropped, and counted by their cause.
"""

from typing import NamedTuple

import numpy as np
import polars as pl

from descentflow.core.constants import KAPPA, R_AIR
from descentflow.core.errors import CleaningError, DataError
from descentflow.core.isa import standard_k
from descentflow.core.units import FPM_MPS, FT_M, KT_MPS
from descentflow.surveillance.cleaning.filters import SECONDS, clock_of, flights_of
from descentflow.surveillance.cleaning.ground_vector import Mask, check_course, stuck, turning
from descentflow.surveillance.cleaning.rates import with_rate
from descentflow.surveillance.rows.air_data import Array, cas_of_mach_kt
from descentflow.surveillance.rows.airspeed_source import (
    COLUMNS_OF_ROWS,
    PLACED,
    REPORTED,
    WEATHER_COLUMNS,
    AirspeedSource,
)
from descentflow.surveillance.rows.drop_report import DropReport
from descentflow.surveillance.rows.schema import AIRSPEEDS, GROUND_VECTOR, MIN_CHECKED_VALUES, POSSIBLE

BESIDE_S = 30.0
"""Rows without airspeeds this near to one of the same flight that reports them are left out, as ever: its own are
better, and two sources in turn would make its speed leap."""
COARSEST_S = 6 * 3600.0
"""Step of a field's times beyond which its wind of the times between is not known."""
CAUSES = (
    "turning",
    "stuck_groundspeed",
    "outside_field_time",
    "coarse_field",
    "outside_field_place",
    "without_weather",
    "impossible_derived",
)
"""Steps of the report, in the order in which a row is counted under the first that it has."""
_POSSIBLE = [(name, *POSSIBLE[name]) for name in AIRSPEEDS]
FEWEST_FLIGHTS, WIDEST_SLOPE = 30, 0.35
"""Flights from which groundspeed is compared with the wind along the track, and how far the slope may be from one."""
CALM_KT = 15.0
"""Spread of the wind along the tracks below which a field's own error, of up to 9 kt, makes the slope less than one."""
STEP_FT = 5000.0
"""Bands of altitude over which flights are averaged for it."""


class RowAir(NamedTuple):
    """Wind (m/s) and temperature (K) of n rows, NaN where unknown, and the causes (3, n) for which they are."""

    east: Array
    north: Array
    temperature_k: Array
    missing: list[Mask]


def with_airspeeds(
    rows: pl.DataFrame, source: AirspeedSource, report: DropReport, seen: pl.DataFrame | None = None
) -> pl.DataFrame:
    """Rows with IAS and Mach, their own or derived, with the column `airspeed_source`.

    Args:
        rows: Sorted by flight and time, with columns for all that is needed.
        source: Of wind and temperature.
        report: Takes the rows that are dropped for each cause.
        seen: Observations of all aircraft (``observations``), if
            these are the source.

    Raises:
        DataError: If the field cannot be used, or groundspeed, track or wind contradict the other columns.

    Example:
        >>> rows = pl.read_parquet("rows.parquet").sort("flight_id", "timestamp").with_columns(
        ...     IAS=pl.lit(None, pl.Float64), Mach=pl.lit(None, pl.Float64),
        ...     u_component_of_wind=0.0, v_component_of_wind=0.0, temperature=240.0)
        >>> derived = with_airspeeds(rows, AirspeedSource.of("columns"), DropReport(by_flight=True))
        >>> derived["airspeed_source"].unique().to_list()
        ['columns']
    """
    lacks = rows.select(pl.any_horizontal(pl.col(AIRSPEEDS).is_null())).to_series().to_numpy()
    beside = lacks & _near(rows, ~lacks)
    rows, lacks = report.count("beside_reported_airspeeds", rows, rows.filter(pl.Series(~beside))), lacks[~beside]
    turns, holds = turning(rows), stuck(rows)
    check_course(rows, ~turns)
    air = _air_of_neighbours(rows, seen) if seen is not None else _air_of(rows, source)
    _check_wind(rows, air, ~turns)
    mach = _mach(rows, air)
    made = {"IAS": cas_of_mach_kt(mach, rows["altitude"].to_numpy()), "Mach": mach}
    impossible = ~np.all([(low <= made[name]) & (made[name] <= high) for name, low, high in _POSSIBLE], 0)
    cause = np.select([turns, holds, *air.missing, impossible], np.arange(1, len(CAUSES) + 1), 0)
    derived = pl.Series(lacks)
    either = [pl.when(derived).then(pl.Series(made[name])).otherwise(name).alias(name) for name in AIRSPEEDS]
    rows = rows.with_columns(
        *(one.fill_nan(None) for one in either),
        derived_IAS=pl.when(pl.Series(~lacks & (cause == 0))).then(pl.Series(made["IAS"])),
        airspeed_source=pl.when(derived).then(pl.lit(source.kind)).otherwise(pl.lit(REPORTED)),
        _cause=pl.Series(np.where(lacks, cause, 0)),
    )
    _note_error(rows, report)
    for number, name in enumerate(CAUSES, 1):
        kept = rows.filter(pl.col("_cause") != number) if (cause[lacks] == number).any() else rows
        rows = report.count(name, rows, kept)
    return rows.drop("_cause")


def _near(rows: pl.DataFrame, reported: Mask) -> Mask:
    """Mask (n,) of rows that have a reported one of the same flight within some seconds."""
    clock = clock_of(flights_of(rows), rows.select(SECONDS).to_series().to_numpy())
    at = np.concatenate([[-np.inf], clock[reported], [np.inf]])
    place = np.searchsorted(at, clock)
    return np.asarray(np.minimum(clock - at[place - 1], at[place] - clock) <= BESIDE_S)


def _mach(rows: pl.DataFrame, air: RowAir) -> Array:
    """Mach numbers (n,), NaN where something is unknown."""
    speed, track = (rows[name].to_numpy() for name in GROUND_VECTOR)
    reported = [name for name in rows.columns if name == "vertical_rate"]
    rate = with_rate(rows.select("flight_id", "timestamp", "altitude", *reported))["vertical_rate"]
    along = np.radians(track)
    east, north = speed * KT_MPS * np.sin(along) - air.east, speed * KT_MPS * np.cos(along) - air.north
    climb = rate.fill_null(0.0).to_numpy() * FPM_MPS
    return np.asarray(np.sqrt((east**2 + north**2 + climb**2) / (KAPPA * R_AIR * air.temperature_k)))


def _air_of(rows: pl.DataFrame, source: AirspeedSource) -> RowAir:
    if source.kind != COLUMNS_OF_ROWS:
        return _air_of_field(rows, source)
    east, north, temperature = (rows[name].to_numpy() for name in WEATHER_COLUMNS)
    none = np.zeros(len(rows), dtype=bool)
    return RowAir(east, north, temperature, [none, none, none, np.isnan(east + north + temperature)])


def _note_error(rows: pl.DataFrame, report: DropReport) -> None:
    """Note how far derived airspeeds are from those of aircraft that report their own; neighbours leave these out."""
    off = (rows["derived_IAS"] - rows["IAS"]).drop_nulls()
    if len(off) >= MIN_CHECKED_VALUES:
        middle, low, high = (float(off.quantile(share) or 0.0) for share in (0.5, 0.159, 0.841))
        report.note(
            f"reported airspeeds, from which those derived at the same rows differ by {middle:+.1f} kt in the median, "
            f"within {(high - low) / 2:.1f} kt of it in two thirds",
            len(off),
        )


def _air_of_neighbours(rows: pl.DataFrame, seen: pl.DataFrame) -> RowAir:
    """Air that others met, along each flight linear in time between the middles of 1,000 ft."""
    from descentflow.surveillance.cleaning._neighbour_air import NeighbourAir, observations

    clock = clock_of(flights_of(rows), rows.select(SECONDS).to_series().to_numpy())
    places = observations(rows.with_columns(clock=pl.Series(clock)), "flight_id").sort("clock")
    at = places["clock"].to_numpy()
    ends = places.group_by("flight_id").agg(first=pl.col("clock").min(), last=pl.col("clock").max())
    bounds = rows.select("flight_id").join(ends, on="flight_id", maintain_order="left")
    inside = clock.clip(bounds["first"].to_numpy(), bounds["last"].to_numpy())
    east, north, deviation = (np.interp(inside, at, values) for values in NeighbourAir(seen).at(places))
    none, warm = np.zeros(len(rows), dtype=bool), standard_k(rows["altitude"].to_numpy() * FT_M) + deviation
    return RowAir(east, north, warm, [none, none, np.isnan(east + warm), none])


def _air_of_field(rows: pl.DataFrame, source: AirspeedSource) -> RowAir:
    """Air of the field at each row's time, level and place."""
    # Not above: reading rows must not pay for xarray.
    from descentflow.weather.weather_field import WIDEST_GAP, Points, weather_field
    from descentflow.weather.weather_layout import EAST, NORTH, TEMPERATURE

    unix_s = rows.select(SECONDS).to_series().to_numpy()
    level_fl = rows["altitude"].to_numpy() / 100.0
    points = Points(unix_s, level_fl, *(rows[name].to_numpy() for name in PLACED))
    with weather_field(source.paths, (TEMPERATURE, EAST, NORTH)) as field:
        times = np.array(field.times)
        if not len(times):
            raise DataError(
                f"{', '.join(map(str, source.paths))}: a weather field without a time",
                expected="the times at which it holds",
                mend="take a file with a coordinate of time: wind of another day makes airspeeds that nobody flew",
            )
        deviation, east, north = field.at(points)
        missing = np.isnan(deviation + east + north)
        early = missing & ((unix_s < times[0]) | (unix_s > times[-1]))
        after = np.searchsorted(times, unix_s).clip(1, max(len(times) - 1, 1))
        gap_s = times[after.clip(max=len(times) - 1)] - times[after - 1]
        usual_s = float(np.median(np.diff(times))) if len(times) > 1 else 0.0
        coarse = ~early & (gap_s > min(COARSEST_S, WIDEST_GAP * usual_s))
        inside = np.ones(len(rows), dtype=bool)
        if missing.any():
            inside[missing] = np.isfinite(field.read(TEMPERATURE, points.rows(missing), blank=True))
    warm = standard_k(rows["altitude"].to_numpy() * FT_M) + deviation
    return RowAir(east, north, warm, [early, coarse, missing & ~inside, missing & inside])


def _check_wind(rows: pl.DataFrame, air: RowAir, straight: Mask) -> None:
    """Refuse a wind that groundspeeds do not follow: that of another day, in another unit, or from where it blows.

    Over flights and bands of altitude, groundspeed grows with the wind along the track by one.
    """
    along = np.radians(rows["track"].to_numpy())
    wind = (air.east * np.sin(along) + air.north * np.cos(along)) / KT_MPS
    number = pl.Series(rows["altitude"].to_numpy() // STEP_FT)
    table = pl.DataFrame({"flight": flights_of(rows), "band": number, "wind": wind, "speed": rows["groundspeed"]})
    means = table.filter(pl.Series(straight & np.isfinite(wind))).group_by("flight", "band").mean().drop_nulls()
    means = means.with_columns((pl.col(name) - pl.col(name).mean().over("band")) for name in ("wind", "speed"))
    flights = means["flight"].n_unique()
    if flights < FEWEST_FLIGHTS or len(means) < MIN_CHECKED_VALUES:
        return
    x, y = means["wind"].to_numpy(), means["speed"].to_numpy()
    if x.std() < CALM_KT:
        return
    slope = float(x @ y / max(float(x @ x), 1e-9))
    # Bands of a flight err together.
    error = float(np.sqrt(np.square(y - slope * x).mean() / (max(float(np.square(x).mean()), 1e-9) * flights)))
    if abs(slope - 1) > max(WIDEST_SLOPE, 4 * error):
        raise CleaningError(
            f"groundspeeds do not follow the wind: over {flights} flights they grow by {slope:.2f} +- {error:.2f} kt "
            "for each kt of wind along the track",
            expected="wind towards east and north in m/s, at the rows' own times (UTC) and places: 1 kt",
            mend="check the day and the unit: 0.51 is a wind in kt that is called m/s, -1 one from where it blows, "
            "0 that of another day, or two components that are swapped",
        )
