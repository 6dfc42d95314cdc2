"""Places that cannot be written, and clocks of rows that are none of 1970."""

import random
from pathlib import Path

import polars as pl

HOUR_S, WEEK_S, DAY_S = 3600.0, 604_800.0, 86_400.0
GPS_LESS_UNIX_S = -315_964_782.0


def bad_place(folder: Path, suffix: str, rng: random.Random) -> Path:
    """A name for an output that is a device, below a file, too long, a link to nowhere, or a folder.

    Args:
        folder: Of the case.
        suffix: That the output must have.
        rng: What chooses.
    """
    (folder / "file").write_text("of others")
    (folder / f"taken{suffix}").mkdir()
    (folder / f"link{suffix}").symlink_to(folder / "nowhere" / f"out{suffix}")
    names = (
        f"/dev/full{suffix}",
        "/dev/full",
        f"/proc/out{suffix}",
        f"file/out{suffix}",
        f"absent/out{suffix}",
        f"{'x' * 300}{suffix}",
        f"link{suffix}",
        f"taken{suffix}",
        "",
        f"new\nline{suffix}",
    )
    return folder / rng.choice(names)


def by_another_clock(frame: pl.DataFrame, rng: random.Random) -> pl.DataFrame:
    """Rows of which all, or those of some aircraft, have times of another origin, unit or zone."""
    seconds = pl.col("timestamp").dt.epoch("us") / 1e6
    aircraft = frame["icao24"].unique(maintain_order=True).to_list()
    chosen = rng.choice((aircraft, aircraft[: max(len(aircraft) // 2, 1)]))
    is_chosen = pl.col("icao24").is_in(chosen)
    clocks = (
        seconds - seconds.min(),
        (seconds - seconds.min()).over("icao24"),
        seconds % WEEK_S,
        seconds % DAY_S,
        seconds + GPS_LESS_UNIX_S,
        seconds / DAY_S + 25_569,
        seconds * rng.choice((1e3, 1e6, 1e9)),
        seconds + HOUR_S * rng.choice((-5, 1, 2, 12)),
        -seconds,
        (seconds / 60).floor() * 60,
    )
    changed = frame.with_columns(pl.when(is_chosen).then(rng.choice(clocks)).otherwise(seconds).alias("timestamp"))
    doubled = rng.random() < 0.2
    return pl.concat([changed, frame.with_columns(seconds.alias("timestamp"))]) if doubled else changed
