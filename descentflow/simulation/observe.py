"""Reports of a radar on flights: Mode S with jitter, losses, sensor noise and quantised fields."""

from collections.abc import Sequence
from dataclasses import dataclass
from dataclasses import fields as dataclass_fields

import numpy as np
import polars as pl
from numpy.typing import NDArray

from descentflow.core.constants import G0_MPS2
from descentflow.core.mode_s_steps import STEPS
from descentflow.core.units import FPM_MPS, FT_M, KT_MPS
from descentflow.simulation.injected import EDGE_M, REFERENCE_MACH, Injected
from descentflow.simulation.truth import Flight
from descentflow.simulation.world_config import WorldConfig

Array = NDArray[np.float64]

EARTH_RADIUS_M = 6_371_000.0
_STREAM = 1
_TRUTH = ("time_s", "altitude_m", "height_m", "cas_mps", "mach", "tas_mps", "groundspeed_mps", "rate_mps")


def observe(
    named: Sequence[Flight],
    truth: pl.DataFrame,
    seed: int,
    numbers: Sequence[int],
    config: WorldConfig,
    injected: Injected,
    tracks_rad: Sequence[float] | None = None,
) -> pl.DataFrame:
    """Report flights as Mode S does; a flight's reports depend on the seed and its own number only.

    Args:
        named: The flights.
        truth: Their truth rows, see :func:`descentflow.simulation.truth.truth_table`, in the order of ``named``.
        seed: Seed of the world.
        numbers: Numbers of the flights in the world.
        config: Interval, jitter, losses and noise.
        injected: Instrument errors and turns of the flights.
        tracks_rad: Track of each flight, where its wind goes by it; drawn if not given.

    Returns:
        Rows in the package's schema, sorted by flight and time.

    Example:
        >>> from descentflow.simulation.truth import name_flights
        >>> from descentflow.simulation.injected import neutral
        >>> named = name_flights("A320", range(2), 0, 5, ["SLO", "SLO"])
        >>> names = [flight.flight_id for flight in named]
        >>> truth = pl.read_parquet("rows_truth.parquet").filter(pl.col("flight_id").is_in(names))
        >>> rows = observe(named, truth, 0, range(2), WorldConfig(), neutral(2))
        >>> (rows["altitude"] % 25).unique().to_list()  # reported in steps of 25 ft
        [0.0]
    """
    lengths = truth.group_by("flight_id", maintain_order=True).len()["len"].to_numpy()
    columns = truth.select(_TRUTH).to_numpy()
    ends = np.cumsum(lengths)
    instruments = _instruments(injected)
    tracks: Sequence[float | None] = tracks_rad or [None] * len(named)
    generators = [np.random.default_rng((seed, number, _STREAM)) for number in numbers]
    reports = [
        _report(columns[end - length : end], generator, config, instrument, track)
        for end, length, generator, instrument, track in zip(
            ends, lengths, generators, instruments, tracks, strict=True
        )
    ]
    kept = [len(r["time_s"]) for r in reports]
    fields = {name: np.concatenate([r[name] for r in reports]) for name in reports[0]}
    start = np.repeat(np.array([f.start_us for f in named], dtype=np.int64), kept)
    timestamp = start + np.rint(fields.pop("time_s") * 1e6).astype(np.int64)
    index = pl.Series(np.repeat(np.arange(len(named), dtype=np.uint32), kept))
    about = {
        name: pl.Series(name, [getattr(f, name) for f in named]).gather(index)
        for name in ("icao24", "callsign", "flight_id", "typecode")
    }
    stamps = pl.Series(timestamp).cast(pl.Datetime("us", "UTC"))
    return pl.DataFrame({"timestamp": stamps, **about, **fields})


@dataclass(frozen=True)
class _Instrument:
    """Injected errors of one flight's instruments, and its turn."""

    cas_bias_mps: float
    cas_bias_slope_mps: float
    rate_lag_s: float
    noise_factor: float
    bank_rad: float
    turn_high_m: float
    turn_low_m: float

    def turned(self, time_s: Array, altitude_m: Array, tas_mps: Array) -> Array:
        """Change of heading since the start, radians."""
        edges = (self.turn_high_m - altitude_m) / EDGE_M, (altitude_m - self.turn_low_m) / EDGE_M
        bank = self.bank_rad * np.clip(edges[0], 0, 1) * np.clip(edges[1], 0, 1)
        turn = G0_MPS2 * np.tan(bank) / tas_mps
        return np.concatenate([[0.0], np.cumsum(0.5 * (turn[1:] + turn[:-1]) * np.diff(time_s))])


def _instruments(injected: Injected) -> list[_Instrument]:
    """One per flight."""
    columns = [getattr(injected, field.name).tolist() for field in dataclass_fields(_Instrument)]
    return [_Instrument(*values) for values in zip(*columns, strict=True)]


def _report(
    truth: Array,
    generator: np.random.Generator,
    config: WorldConfig,
    instrument: _Instrument,
    known_track: float | None,
) -> dict[str, Array]:
    """Report one flight; linear between truth rows, which are closer than any field changes."""
    due = truth[:, 0]
    n = len(due)
    time = np.clip(due + generator.uniform(-config.jitter_s, config.jitter_s, n), due[0], due[-1])
    keep = generator.random(n) >= config.dropout_share
    has_gap, gap_start, gap_length = generator.random(3)
    if has_gap < config.gap_share:
        begin = due[0] + gap_start * (due[-1] - due[0])
        length = config.gap_s[0] + gap_length * (config.gap_s[1] - config.gap_s[0])
        keep &= (time < begin) | (time > begin + length)
    noise = instrument.noise_factor * generator.standard_normal((5, n))
    track, latitude, longitude, distance = _place(generator)
    track = track if known_track is None else known_track
    _, altitude, height, cas, mach, tas, groundspeed, rate = truth.T
    rate_fpm = _smoothed(rate / FPM_MPS, due, config.rate_smoothing_s + instrument.rate_lag_s)
    cas = cas + instrument.cas_bias_mps + instrument.cas_bias_slope_mps * (mach - REFERENCE_MACH)
    keep &= np.concatenate([[True], np.diff(time) > 0])
    time, noise = time[keep], noise[:, keep]

    def at(values: Array) -> Array:
        return np.interp(time, due, values)

    if instrument.bank_rad:
        turned = instrument.turned(due, altitude, tas)
        flown_north, flown_east = (at(_travelled(groundspeed * f(track + turned), due)) for f in (np.cos, np.sin))
        bearing = np.degrees(track + at(turned)) % 360
        north, east = (flown_north - distance * np.cos(track)), (flown_east - distance * np.sin(track))
    else:
        flown = at(_travelled(groundspeed, due))
        bearing = np.full_like(time, np.degrees(track))
        north, east = (flown - distance) * np.cos(track), (flown - distance) * np.sin(track)
    north, east = north / EARTH_RADIUS_M, east / EARTH_RADIUS_M / np.cos(latitude)
    fields = {
        "altitude": at(altitude) / FT_M + config.altitude_noise_ft * noise[0],
        "vertical_rate": at(rate_fpm) + config.rate_noise_fpm * noise[1],
        "IAS": at(cas) / KT_MPS + config.cas_noise_kt * noise[2],
        "Mach": at(mach) + config.mach_noise * noise[3],
        "TAS": at(tas) / KT_MPS + config.tas_noise_kt * noise[4],
        "groundspeed": at(groundspeed) / KT_MPS,
        "track": bearing,
        "heading": bearing,
        "geoaltitude": at(height) / FT_M,
    }
    counted = {name: np.rint(value / STEPS[name]) * STEPS[name] for name, value in fields.items()}
    place = {"latitude": np.degrees(latitude + north), "longitude": np.degrees(longitude + east)}
    return {"time_s": time, **counted, **place}


def _travelled(speed_mps: Array, time_s: Array) -> Array:
    """Distance since the start."""
    return np.concatenate([[0.0], np.cumsum(0.5 * (speed_mps[1:] + speed_mps[:-1]) * np.diff(time_s))])


def _place(generator: np.random.Generator) -> tuple[float, float, float, float]:
    """Track, and the point that the flight passes after a distance; radians and metres."""
    uniform = generator.random(4)
    track = 2 * np.pi * uniform[0]
    latitude, longitude = np.radians(50 + 4 * uniform[1]), np.radians(3 + 4 * uniform[2])
    return float(track), float(latitude), float(longitude), float(1e5 * uniform[3])


def _smoothed(values: Array, time_s: Array, constant_s: float) -> Array:
    """First-order lag, as the transponder's own smoothing."""
    if constant_s == 0 or len(values) < 2:
        return values
    keep = np.exp(-np.diff(time_s) / constant_s)
    result = np.empty_like(values)
    result[0] = held = values[0]
    for i, (k, value) in enumerate(zip(keep.tolist(), values[1:].tolist(), strict=True), start=1):
        held = k * held + (1 - k) * value
        result[i] = held
    return result
