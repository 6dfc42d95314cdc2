"""Samples of a model as prepared descents, each flown by an aircraft of its own."""

from datetime import UTC, datetime

import numpy as np
import polars as pl

from descentflow.core.units import FPM_MPS, KT_MPS
from descentflow.representation.decoder.trajectories import Trajectories
from descentflow.surveillance.descents.prepared_descents import Descents, top_levels
from descentflow.surveillance.descents.store import SCHEMA_VERSION

BEGINNING = datetime(2000, 1, 1, tzinfo=UTC)
"""Start of all samples: they know no date."""


def sampled_descents(flown: Trajectories, typecode: str, settings: dict[str, float | None] | None = None) -> Descents:
    """Prepared descents of samples: IAS, Mach, TAS in standard air and the rate, on every level below their entry.

    Args:
        flown: Sampled descents.
        typecode: Their type.
        settings: Cleaning settings of the flights that the model was trained on; None if not known.

    Example:
        >>> from descentflow.generation.sample import sample
        >>> found = sampled_descents(sample("best.ckpt", 70, entry_fl=330).trajectories, "A320")
        >>> found.flights, found.frame["level_fl"].max(), found.frame["icao24"].n_unique()
        ({'A320': 70}, 330, 70)
    """
    seen = flown.mask.cpu().numpy()[:, ::-1]
    n, n_levels = seen.shape
    row = np.broadcast_to(np.arange(n)[:, None], (n, n_levels))[seen]
    levels = np.broadcast_to(flown.levels_fl.cpu().numpy().astype(np.int32)[::-1], (n, n_levels))[seen]
    channels = {
        "time_s": flown.time_s,
        "vertical_rate": flown.rate_mps / FPM_MPS,
        "IAS": flown.cas_mps / KT_MPS,
        "Mach": flown.mach,
        "TAS": flown.tas_mps / KT_MPS,
    }
    columns = {name: value.detach().double().cpu().numpy()[:, ::-1][seen] for name, value in channels.items()}
    table = pl.DataFrame({"row": row, "level_fl": levels, **columns}).with_columns(
        flight_id="sample-" + pl.col("row").cast(pl.String).str.zfill(6),
        icao24="sample-" + pl.col("row").cast(pl.String).str.zfill(6),
        typecode=pl.lit(typecode),
        timestamp=pl.lit(BEGINNING) + pl.duration(microseconds=(pl.col("time_s") * 1e6).round().cast(pl.Int64)),
    )
    ordered = table.select("flight_id", "icao24", "typecode", "level_fl", "timestamp", *channels)
    known = {} if settings is None else {"settings": settings}
    bottom = int(flown.levels_fl[0])
    about = {"schema_version": SCHEMA_VERSION, "bottom_fl": bottom, "top_fl": top_levels(ordered), "inputs": []}
    return Descents(ordered, {**about, **known})
