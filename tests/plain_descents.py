"""The decoder's integration in the equations' own order, with which the package's is compared."""

import torch
from torch import Tensor

from descentflow.physics.energy import descent_rate_mps
from descentflow.physics.idle_state import idle_state
from descentflow.physics.performance_model import PerformanceModel
from descentflow.representation.decoder.flight_grid import rate_breaks


def plain_descents(
    aircraft: PerformanceModel,
    altitude_m: Tensor,
    drag_n: Tensor,
    cas_mps: Tensor,
    entry: Tensor,
    mass_kg: float | None = None,
    deviation_k: float = 0.0,
) -> dict[str, Tensor]:
    """Time, Mach, TAS and rate (n, L): trapezoids between levels and both sides of each jump of the rate."""
    breaks = rate_breaks(aircraft, altitude_m)
    places = torch.cat([altitude_m, breaks.altitude_m])
    order = places.argsort()
    drag, cas = (torch.cat([values, breaks.continued(values)], 1) for values in (drag_n, cas_mps))
    state = idle_state(aircraft, cas, places, deviation_k)
    rate = descent_rate_mps(
        aircraft, drag, state.thrust_n, state.tas_mps, state.energy_share, places, deviation_k, mass_kg
    )
    slow = (-1 / rate)[:, order]
    legs = (slow[:, 1:] + slow[:, :-1]) / 2 * places[order].diff()
    climbed = torch.nn.functional.pad(legs.cumsum(1), (1, 0))[:, order.argsort()[: len(altitude_m)]]
    columns = {"mach": state.mach, "tas_mps": state.tas_mps, "rate_mps": rate}
    return {
        "time_s": climbed.gather(1, entry[:, None]) - climbed,
        **{name: value[:, : len(altitude_m)] for name, value in columns.items()},
    }
