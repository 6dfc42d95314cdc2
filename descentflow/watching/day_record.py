"""Record of a day of real flights beside a simulator: means and their variances, and no flight."""

from collections.abc import Mapping
from typing import Any

import numpy as np
import polars as pl
import torch

from descentflow.diagnosis.gap.costs import flown, simulator_rows
from descentflow.diagnosis.sides.measured_sides import both_sides
from descentflow.diagnosis.sides.simulator import Simulator
from descentflow.diagnosis.sides.two_sides import Compared, compare
from descentflow.measurements.quantity_registry import CHANNELS
from descentflow.qualification.equivalence import mean_of
from descentflow.watching.change_evidence import DayMeans

PARTS = {"below FL200": (0.0, 200.0), "FL200 to FL280": (200.0, 280.0), "above FL280": (280.0, 1000.0)}
"""Parts of the levels, by which the size of a change is summed: not every day shows all of them."""
WATCHED = {
    "rate": ("rate of descent at equal speed, in the flight's own air", "%", 100.0),
    "cas": ("calibrated airspeed", "kt", 1.0),
    "mismatch": ("IAS against Mach number", "kt", 1.0),
    "lag": ("reported rate against altitude over time", "%", 100.0),
}
"""Quantity -> its name for readers, its unit, and the factor of that; the air itself is not watched."""
SIZES = ("time_at_speed", "fuel")
"""Costs by which the size of a change is stated."""


def day_record(simulator: Simulator, frame: pl.DataFrame) -> dict[str, float | int | None]:
    """Means of a day's flights minus the simulator's: ``mean``, ``within`` and ``flights`` of each watched number.

    The variance of a mean is over whole aircraft. Times at equal speed (s) and fuel (kg) by part of the levels are kept
    too, for the size of a change.

    Args:
        simulator: What is watched.
        frame: Prepared descents of one day.

    Raises:
        DataError: If the flights are too few, or show no level of the simulator's grid.
    """
    sides = both_sides(simulator, frame, CHANNELS)
    compared = compare(sides.simulated, sides.real, simulator.aircraft)
    freed, record = compared.in_own_air(), _counts(frame, compared)
    for quantity in WATCHED:
        record |= _watched(freed if quantity == "rate" else compared, quantity)
    costs = flown(compared, compared.y)
    for name in SIZES:
        for part in PARTS:
            at = _bands(compared, part)
            sums = costs[name][compared.real][:, at].nanmean(0)
            record[f"{name} {part}"] = float(sums.nansum()) if bool(sums.isfinite().any()) else None
    return record


def _counts(frame: pl.DataFrame, compared: Compared) -> dict[str, float | int | None]:
    return {"flights": int(compared.real.sum()), "aircraft": frame["icao24"].n_unique()}


def _bands(compared: Compared, part: str) -> torch.Tensor:
    low, high = PARTS[part]
    return torch.tensor([k for k, fl in enumerate(compared.middles_fl()) if low <= fl < high], dtype=torch.long)


def _watched(compared: Compared, quantity: str) -> Mapping[str, float | int | None]:
    """Mean over the day's flights of each flight's mean over all bands."""
    table = compared.table(quantity, compared.y)
    usual = table[simulator_rows(compared)].nanmean(0) if compared.has_simulated else torch.zeros(table.shape[1])
    own = (table - usual)[compared.real].nanmean(1).numpy()
    aircraft = compared.airframe[compared.real].numpy()
    mean = mean_of(own, aircraft, np.zeros(len(own), dtype=np.int64))
    known = mean.flights > 0 and np.isfinite(mean.variance)
    return {
        f"{quantity}: mean": mean.mean if known else None,
        f"{quantity}: variance": mean.variance if known else None,
        f"{quantity}: flights": mean.flights,
    }


def means_of(days: pl.DataFrame) -> DayMeans:
    """Means and variances (n, q) of what is watched; NaN where a day shows none of it."""

    def table(what: str) -> np.ndarray[Any, Any]:
        columns = [f"{quantity}: {what}" for quantity in WATCHED]
        return np.stack([days[name].cast(pl.Float64).fill_null(np.nan).to_numpy() for name in columns], 1)

    return DayMeans(table("mean"), table("variance"))
