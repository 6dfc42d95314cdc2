"""A comparison with the causes put into the simulator's flights: what closure, costs and curves are measured on.

The same changes go into `corrected.parquet` and `corrected.ckpt`, level by level; here they go into the means by band.
So what is said of a correction is said of flights that have it, and not of the shift that was fitted.
"""

from dataclasses import replace

import torch
from torch import Tensor

from descentflow.core.units import KT_MPS
from descentflow.diagnosis.correction.effects_in_flights import Correction, changes_of
from descentflow.diagnosis.findings.cause_found import ClosedShare
from descentflow.diagnosis.inference.labellings import distances, labellings_of, mean_over_quantities, noise_floor
from descentflow.diagnosis.inference.two_sides import Compared
from descentflow.effects.flight_state import FlightState, log_rate

FLOORS = 30
"""Labellings behind a noise floor."""
GROUPS = 20
"""Groups of aircraft that are left out in turn, for the interval of a closure."""
NINETY = 1.645
LEAST_GAP = 1.02
"""Gap, in noise floors, below which there is none to close."""


def corrected_entries(compared: Compared, correction: Correction) -> Tensor:
    """Entries (n, p) of both sides once the simulator has the effects.

    Args:
        compared: Flights of both sides.
        correction: What is put in.

    Example:
        >>> from descentflow.diagnosis.inference.example_sides import example_sides
        >>> from descentflow.effects import EFFECTS
        >>> from descentflow.surveillance.cleaning.thresholds import Cleaning
        >>> sides = example_sides(EFFECTS["temperature"], [10.0])
        >>> warm = Correction(EFFECTS, {"temperature": torch.tensor([10.0])}, 60e3, Cleaning(), seed=0)
        >>> left, tas = corrected_entries(sides, warm), sides.columns("tas")
        >>> apart = left[sides.real][:, tas].mean() - left[~sides.real][:, tas].mean()
        >>> bool(abs(apart) < 0.001)  # 2 % before
        True
    """
    simulated = torch.nonzero(~compared.real)[:, 0]
    left = compared.y.clone()
    if not len(simulated) or not correction.theta:
        return left
    state = _before(compared, simulated)
    flown, reported = changes_of(state, correction)
    moved = dict(flown)
    moved["cas"] = flown["cas"] + reported["cas"]
    # The rate of a comparison is beyond the polar's at the speed that the flight reports.
    faster = log_rate(state, cas_mps=state.cas_mps + moved["cas"] * KT_MPS) - state.own_log_rate
    moved["rate"] = flown["rate"] + reported["rate"] - faster
    moved["tas"] = flown["tas"] + reported["tas"]
    moved["lag"], moved["mismatch"] = reported["rate"], reported["cas"]
    for name in ("wind", "height"):
        moved[name] = state.centred(flown[name] + reported[name])
    moved |= {name: value for name, value in reported.items() if name not in moved}
    for i, entry in enumerate(compared.entries):
        if entry.quantity in moved:
            change = moved[entry.quantity]
            left[simulated, i] += change[:, entry.band] if entry.band >= 0 else change
    return left


def _before(compared: Compared, simulated: Tensor) -> FlightState:
    """The simulator's flights as effects are put into them, each at its own rate."""
    state = compared.state.rows_of_fleet(simulated)
    beyond = torch.zeros_like(state.cas_mps)
    for i, entry in enumerate(compared.entries):
        if entry.quantity == "rate":
            beyond[:, entry.band] = compared.y[simulated, i].nan_to_num(0.0)
    return replace(state, affected=False, beyond_polar=beyond)


class MeasuredClosure:
    """Mean difference of both sides over some entries, in spreads between flights, before and after a correction.

    Example:
        >>> from descentflow.diagnosis.inference.example_sides import example_sides
        >>> from descentflow.effects import EFFECTS
        >>> from descentflow.surveillance.cleaning.thresholds import Cleaning
        >>> sides = example_sides(EFFECTS["temperature"], [10.0])
        >>> warm = Correction(EFFECTS, {"temperature": torch.tensor([10.0])}, 60e3, Cleaning(), seed=0)
        >>> measured = MeasuredClosure(sides, sides.of("tas"), seed=0)
        >>> measured.share(corrected_entries(sides, warm)).estimate > 0.9
        True
    """

    def __init__(self, compared: Compared, entries: Tensor, seed: int) -> None:
        """Measure the gap.

        Args:
            compared: Flights of both sides.
            entries: (p,) those over which it is measured.
            seed: Of the labellings and groups of aircraft.
        """
        self._part = compared.only(torch.nonzero(entries)[:, 0])
        self._at, self._seed = torch.nonzero(entries)[:, 0], seed
        self._everyone = torch.ones(len(compared.y), dtype=torch.bool)
        # Of means: that a simulator's flights differ less widely than real ones is no cause's matter.
        self._means = torch.ones(len(self._at), dtype=torch.bool)
        self.before = self._distance(compared.y, self._everyone)
        self._before_of_fleets = [self._distance(compared.y, kept) for kept in self._fleets]

    @property
    def _fleets(self) -> list[Tensor]:
        """Flights (n,) without one group of aircraft of each side in turn."""
        names, index = torch.unique(self._part.airframe, return_inverse=True)
        shuffled = torch.randperm(len(names), generator=torch.Generator().manual_seed(self._seed))
        group = shuffled[index] % GROUPS
        return [group != k for k in range(GROUPS)]

    def after(self, left: Tensor) -> float:
        """The distance once entries are (n, p)."""
        return self._distance(left, self._everyone)

    def floor(self, left: Tensor) -> float:
        """The distance that two samples of one population of these sizes show."""
        part = self._part
        dealt = list(labellings_of(part, FLOORS, self._seed))[1:]
        return self._over(noise_floor(left[:, self._at], part.real, dealt, part.scale, self._means))

    def share(self, left: Tensor) -> ClosedShare:
        """Share of the gap above the floor that is closed, with a 90 % interval by the jackknife over aircraft."""
        floor = self.floor(left)
        estimate = closed_share(self.before, self.after(left), floor)
        fleets = zip(self._before_of_fleets, self._fleets, strict=True)
        found = [closed_share(before, self._distance(left, kept), floor) for before, kept in fleets]
        known = torch.tensor([one for one in found if one is not None], dtype=torch.float64)
        if estimate is None or len(known) < GROUPS:
            return ClosedShare(estimate, None, None)
        error = float(((GROUPS - 1) / GROUPS * (known - known.mean()).square().sum()).sqrt())
        return ClosedShare(estimate, estimate - NINETY * error, estimate + NINETY * error)

    def _distance(self, y: Tensor, kept: Tensor) -> float:
        part = self._part
        return self._over(distances(y[kept][:, self._at], part.real[kept], part.scale, self._means))

    def _over(self, found: Tensor) -> float:
        everything = torch.ones(len(found), dtype=torch.bool)
        return float(mean_over_quantities(self._part, found, everything))


def closed_share(before: float, after: float, floor: float) -> float | None:
    """Share of a gap that is closed: one where the rest is at the floor; None where there was no gap.

    Example:
        >>> closed_share(1.1, 0.35, 0.1), closed_share(0.1, 0.1, 0.1)
        (0.75, None)
    """
    return None if before <= floor * LEAST_GAP else 1.0 - (after - floor) / (before - floor)
