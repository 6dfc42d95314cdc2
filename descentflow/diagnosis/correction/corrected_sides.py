"""A comparison with the causes put into the simulator's flights: what closure, costs and curves are measured on.

The same changes go into `corrected.parquet` and `corrected.ckpt`, level by level; here they go into the means by band.
So what is said of a correction is said of flights that have it, and not of the shift that was fitted.
"""

from dataclasses import replace

import torch
from torch import Tensor

from descentflow.core.units import KT_MPS
from descentflow.diagnosis.correction.effects_in_flights import AddedEffects, changes_of
from descentflow.diagnosis.inference.two_sides import Compared
from descentflow.effects.flight_state import FlightState, log_rate


def corrected_entries(compared: Compared, added: AddedEffects) -> Tensor:
    """Entries (n, p) of both sides once the simulator has the effects.

    Args:
        compared: Flights of both sides.
        added: What is put in.
    """
    simulated = torch.nonzero(~compared.real)[:, 0]
    left = compared.y.clone()
    if not len(simulated) or not added.theta:
        return left
    state = _before(compared, simulated)
    flown, reported = changes_of(state, added)
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
    return replace(state, affected=False, beyond_polar=compared.table("rate", compared.y[simulated]).nan_to_num(0.0))
