"""Record of a day of real flights next to a simulator: means and their variances, and no flight."""

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
from descentflow.qualification.equivalence import Numbers, mean_of
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
    return record_of(compared) | {"aircraft": frame["icao24"].n_unique()}


def record_of(compared: Compared) -> dict[str, float | int | None]:
    """The same of flights that are measured and compared."""
    record: dict[str, float | int | None] = {"flights": int(compared.real.sum())}
    for quantity in WATCHED:
        record |= _watched(compared, quantity)
    costs = flown(compared, compared.y)
    for name in SIZES:
        for part, (low, high) in PARTS.items():
            at = torch.tensor([low <= fl < high for fl in compared.middles_fl()])
            sums = costs[name][compared.real][:, at].nanmean(0)
            record[f"{name} {part}"] = float(sums.nansum()) if bool(sums.isfinite().any()) else None
    return record


def differences(compared: Compared, quantity: str) -> Numbers:
    """Mean of each real flight (n,) over all bands, minus the simulator's; the rate in each flight's own air."""
    compared = compared.in_own_air() if quantity == "rate" else compared
    table = compared.table(quantity, compared.y)
    usual = table[simulator_rows(compared)].nanmean(0) if compared.has_simulated else torch.zeros(table.shape[1])
    own: Numbers = (table - usual)[compared.real].nanmean(1).numpy()
    return own


def _watched(compared: Compared, quantity: str) -> Mapping[str, float | int | None]:
    """Mean of the day's flights."""
    own = differences(compared, quantity)
    mean = mean_of(own, compared.airframe[compared.real].numpy(), np.zeros(len(own), dtype=np.int64))
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
