"""Samples in BlueSky 1.1: a scenario (``.scn``), or a plugin that flies samples at every step (``.py``)."""

from pathlib import Path

import numpy as np
import polars as pl
from numpy.typing import NDArray

from descentflow.core.errors import ConfigError
from descentflow.core.files import write_whole
from descentflow.core.units import KT_MPS, NM_M
from descentflow.exports._plugin import write_plugin
from descentflow.exports.export_request import ExportRequest
from descentflow.positions.wind import WindByLevel

AHEAD_FT = 1000.0
"""Altitudes are selected so far below the flight and no further: BlueSky 1.1.1 limits the speed as if it was there."""
Array = NDArray[np.float64]
STEP_S = 4.0
"""Between commands."""
STEEPEST_FPM = 3100.0
"""Below BlueSky's limit of its airliners (3,157 ft/min of the A320, 3,201 of the B738): 1.1.1 holds descents to the
largest rate of climb, and beyond it doubles or stops them while speed changes."""
RAMP_FPM_S = 300.0
"""BlueSky's vertical acceleration; changes of less than 300 ft/min are made at once."""
SLOWEST_FPM = 100.0
"""Below 20 ft/min BlueSky takes its own 1,500 ft/min."""
CATCH_UP_S = 20.0
"""An altitude that is off is made good at this rate: a correction within one step would swing."""


def write(request: ExportRequest, *others: ExportRequest) -> list[Path]:
    """Write ``NAME.scn``, or the plugin ``NAME.py`` with its samples, ``NAME.json``.

    Raises:
        ConfigError: If a scenario has no path, or a wind that is neither constant nor by level.

    Example:
        >>> from descentflow.densities.checkpoint import load_model
        >>> [path.name for path in write(ExportRequest(load_model("best.ckpt"), Path("descents.py"), n=5))]
        ['descents.py', 'descents.json']
    """
    if request.path.suffix == ".py":
        return write_plugin("bluesky_plugin.py", request, *others)
    text = "\n".join(scenario(request, *others)) + "\n"
    write_whole(request.path, text.encode("ascii"))
    return [request.path]


def scenario(request: ExportRequest, *others: ExportRequest) -> list[str]:
    """The lines of a scenario, in the order of time; flights of several models take turns.

    Example:
        >>> from descentflow.densities.checkpoint import load_model
        >>> from descentflow.positions.ground_plan import ground_plan
        >>> plan = ground_plan(end=(51.47, -0.45), track=270.0)
        >>> lines = scenario(ExportRequest(load_model("best.ckpt"), Path("d.scn"), n=2, plan=plan))
        >>> lines[1].split(" ")[0][-4:], lines[-1].split(" ")[0][-3:]
        ('>CRE', 'SPD')
    """
    if request.plan.path is None:
        raise ConfigError(
            "a scenario without places",
            expected="an end point and a track, or a route",
            mend="give --end and --track, or --route; or write the plugin, --out NAME.py",
        )
    timed, flown = [], []
    for each in (request, *others):
        table = each.samples.to_polars().partition_by("sample_id", maintain_order=True)
        for i, (number, rows) in enumerate(zip(each.numbers, table, strict=True)):
            start = each.every_s * number - rows["time_s"][-1]
            typecode = each.types[i % len(each.types)]
            timed += [(start + after, line) for after, line in _flight(each.callsign(number), typecode, request, rows)]
        flown.append(f"{each.n} sampled descents of {each.typecode}, seed {each.seed}")
    begin = min(time for time, _ in timed)
    lines = [(0.0, line) for line in _wind(request)] + [(time - begin, line) for time, line in timed]
    return [f"# {'; '.join(flown)}", *map(_line, sorted(lines, key=lambda line: line[0]))]


def _flight(name: str, typecode: str, request: ExportRequest, rows: pl.DataFrame) -> list[tuple[float, str]]:
    """Commands of one flight, each with its seconds after the sample's beginning."""
    time_s, altitude_ft, cas_kt = (rows[column].to_numpy() for column in ("time_s", "altitude_ft", "CAS"))
    rate = first_rate(time_s, altitude_ft)
    before_s, above_ft = run_up(rate)
    path = request.plan.path
    assert path is not None, "checked by the caller"
    first = rows.row(0, named=True)
    to_go_m = first["distance_to_go_nm"] * NM_M + first["groundspeed"] * KT_MPS * before_s
    latitude, longitude, track = (float(value[0]) for value in path.at(np.array([to_go_m])))
    place = f"{latitude:.6f} {longitude:.6f} {track:.2f}"
    lines = [f"CRE {name} {typecode} {place} {altitude_ft[0] + above_ft:.1f} {cas_kt[0]:.2f}"]
    for leg in np.flatnonzero(path.start_m < to_go_m)[::-1]:
        lines.append(f"ADDWPT {name} {path.end_latitude[leg]:.6f} {path.end_longitude[leg]:.6f}")
    lines += [f"LNAV {name} ON", f"VNAV {name} OFF", f"ALT {name} {altitude_ft[0] - AHEAD_FT:.0f} {rate:.1f}"]
    timed = [(-before_s, line) for line in lines]
    rates, altitudes = commanded_rates(time_s, altitude_ft)
    speeds = np.interp(STEP_S * (np.arange(len(rates)) + 0.5), time_s, cas_kt)
    for k, (rate, altitude, speed) in enumerate(zip(rates, altitudes, speeds, strict=True)):
        timed.append((STEP_S * k, f"ALT {name} {max(altitude - AHEAD_FT, altitude_ft[-1]):.0f} {rate:.1f}"))
        timed.append((STEP_S * k, f"SPD {name} {speed:.2f}"))
    # By altitude, not by time: a flight that you held up still ends where the samples do.
    timed.append((0.0, f"ATALT {name} {altitude_ft[-1]:.0f} DEL {name}"))
    return timed


def _line(timed: tuple[float, str]) -> str:
    hundredths = round(100 * timed[0])
    minutes, rest = divmod(hundredths, 6000)
    hours, minutes = divmod(minutes, 60)
    return f"{hours:02d}:{minutes:02d}:{rest / 100:05.2f}>{timed[1]}"


def _wind(request: ExportRequest) -> list[str]:
    """BlueSky's command for the wind, if there is one."""
    wind, path = request.plan.wind, request.plan.path
    if wind is None or path is None:
        return []
    if not isinstance(wind, WindByLevel):
        raise ConfigError(
            "a field of wind in a scenario of BlueSky",
            expected="a wind that is constant or by level",
            mend="give --wind for instance as 150:270/20,350:270/60",
        )
    levels = wind.levels_fl if len(wind.levels_fl) > 1 else np.array([0.0, 450.0])
    words = []
    for level in levels:
        east, north = wind.at(float(level), np.zeros(1), np.zeros(1), None)
        blows_from = np.degrees(np.arctan2(-east[0], -north[0])) % 360
        words.append(f"{level * 100:.0f} {blows_from:.1f} {np.hypot(east[0], north[0]) / KT_MPS:.3f}")
    return [f"WIND {path.end_latitude[0]:.4f} {path.end_longitude[0]:.4f} {' '.join(words)}"]


def commanded_rates(time_s: Array, altitude_ft: Array) -> tuple[Array, Array]:
    """Rates to command every :data:`STEP_S` seconds, and the altitudes that BlueSky has when they are given.

    Each is the sample's mean rate until the next command, and what makes good the altitude that the limit kept back.
    The flight comes with the sample's first rate: see :func:`run_up`.

    Args:
        time_s: (k,) from zero, ascending.
        altitude_ft: (k,) descending.

    Returns:
        Rates (ft/min, negative) and altitudes (ft), a pair for each command.

    Example:
        >>> rates, altitudes = commanded_rates(np.array([0.0, 600.0]), np.array([35_000.0, 15_000.0]))
        >>> rates[60:63].round()
        array([-2000., -2000., -2000.])
    """
    times = np.arange(0.0, time_s[-1], STEP_S)
    planned = np.interp(np.append(times, times[-1] + STEP_S), time_s, altitude_ft)
    rates, altitudes = np.empty(len(times)), np.empty(len(times))
    altitude, rate = float(altitude_ft[0]), first_rate(time_s, altitude_ft)
    for k in range(len(times)):
        wanted = 60 * ((planned[k + 1] - planned[k]) / STEP_S + (planned[k] - altitude) / CATCH_UP_S)
        rates[k], altitudes[k] = min(max(wanted, -STEEPEST_FPM), -SLOWEST_FPM), altitude
        change, rate = _flown(rate, float(rates[k]))
        altitude += change
    return rates, altitudes


def first_rate(time_s: Array, altitude_ft: Array) -> float:
    """The rate (ft/min) with which a sample begins, within what can be commanded.

    Example:
        >>> round(first_rate(np.array([0.0, 600.0]), np.array([35_000.0, 15_000.0])))
        -2000
    """
    slope = 60 * float(np.interp(STEP_S, time_s, altitude_ft) - altitude_ft[0]) / STEP_S
    return min(max(slope, -STEEPEST_FPM), -SLOWEST_FPM)


def run_up(rate_fpm: float) -> tuple[float, float]:
    """Lead time (s) and height above (ft) at which a level flight must begin to descend to have a rate in time.

    Example:
        >>> run_up(-2100.0)  # six seconds of 300 ft/min each; the last 300 at once
        (6.0, 90.0)
    """
    seconds = max(abs(rate_fpm) - RAMP_FPM_S, 0.0) / RAMP_FPM_S
    return seconds, RAMP_FPM_S * seconds**2 / 2 / 60


def _flown(rate_fpm: float, target_fpm: float) -> tuple[float, float]:
    """Altitude change (ft) of one step towards another rate, and the rate at its end."""
    change = target_fpm - rate_fpm
    ramp_s = max(abs(change) - RAMP_FPM_S, 0.0) / RAMP_FPM_S
    slope = float(np.sign(change)) * RAMP_FPM_S
    if ramp_s >= STEP_S:
        return (rate_fpm * STEP_S + slope * STEP_S**2 / 2) / 60, rate_fpm + slope * STEP_S
    during = rate_fpm * ramp_s + slope * ramp_s**2 / 2
    return (during + target_fpm * (STEP_S - ramp_s)) / 60, target_fpm
