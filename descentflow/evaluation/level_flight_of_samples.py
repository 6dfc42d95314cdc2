"""Level flight of real descents, samples and a simulator, side by side."""

from collections.abc import Mapping

import numpy as np
import polars as pl

from descentflow.core.units import FPM_MPS
from descentflow.evaluation.metrics.descent_set import DescentSet
from descentflow.surveillance.cleaning.level_flight import note_level_flight, stretches
from descentflow.surveillance.rows.drop_report import DropReport


def sampled_level_flight(samples: DescentSet) -> Mapping[str, int]:
    """Notes of level flight in samples, as `prepare` has them of rows: their levels stand for reports.

    Example:
        >>> from descentflow.generation.sample import sample
        >>> samples = DescentSet.of_trajectories(sample("best.ckpt", 50).trajectories)
        >>> list(sampled_level_flight(samples).values())  # they descend freely
        [50, 50]
    """
    rows, levels = np.nonzero(samples.mask.numpy())
    report = DropReport()
    table = pl.DataFrame(
        {
            "flight_id": rows,
            "timestamp": pl.Series(1e6 * samples.time_s.numpy()[rows, levels]).cast(pl.Datetime("us")),
            "altitude": 100 * samples.levels_fl.numpy()[levels],
            "vertical_rate": samples.rate_mps.numpy()[rows, levels] / FPM_MPS,
        }
    )
    note_level_flight(stretches(table, gap_s=float("inf")), report)
    return report.notes


def in_words(sides: pl.DataFrame) -> list[str]:
    """A line for each set of flights; none where flights were not counted.

    Args:
        sides: Of :func:`~descentflow.surveillance.cleaning.level_flight.side_by_side`.

    Example:
        >>> from descentflow.surveillance.cleaning.level_flight import CONTINUOUS, FLIGHTS, IN_BAND, side_by_side
        >>> in_words(side_by_side({"flights": {FLIGHTS: 4, CONTINUOUS: 1, f"{IN_BAND}050": 200}}))
        ['level flight in descents of flights (4): 25 % have none, 50 s in the mean']
    """
    by_side = sides.group_by("side", "flights", "continuous", maintain_order=True).agg(pl.col("level_s").sum())
    return [
        f"level flight in descents of {name} ({n:,}): {100 * share:.0f} % have none, {seconds:.0f} s in the mean"
        for name, n, share, seconds in by_side.iter_rows()
    ]
