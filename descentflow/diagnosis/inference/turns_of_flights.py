r"""Change of flights' rates by turns, from the induced drag that their headings imply.

Each flight turns elsewhere, which is what brakes look like that each flight uses at its own levels. So rates are taken
against the polar with the induced drag of the flight's own turns, beyond the mean of its side:

.. math:: y_i = \ln R_i - \ln \hat R_i - (e_i - \bar e), \qquad
   e_i = \ln \hat R_i(C_{D2}\, n_i^2) - \ln \hat R_i(C_{D2}).

Means stay as they are. By how much the real flights turn more than the simulator's is left to the effect of the
catalogue for it.
"""

import torch
from torch import Tensor

from descentflow.effects.flight_state import FlightState, log_rate


def turned_more(turning: Tensor, real: Tensor) -> Tensor:
    """Share (K,) by which turns raise the induced drag of real flights more than of the simulator's, in the mean.

    A simulator of whose turns nothing is known is taken to fly straight.

    Args:
        turning: (n, K) of each flight, NaN where it is not known.
        real: (n,) which flights are real.

    Example:
        >>> turned_more(torch.tensor([[0.1, torch.nan], [0.3, 0.2]]), torch.tensor([False, True]))
        tensor([0.2000, 0.2000])
    """
    return turning[real].nanmean(0).nan_to_num(0.0) - turning[~real].nanmean(0).nan_to_num(0.0)


def by_own_turns(state: FlightState, turning: Tensor, real: Tensor) -> Tensor:
    """Change (n, K) of ln rate by each flight's own turns beyond the mean of its side; zero where they are not known.

    Args:
        state: The flights.
        turning: (n, K) share by which turns raise their induced drag, NaN where it is not known.
        real: (n,) which flights are real.

    Example:
        >>> from descentflow.effects.example_flights import example_flights
        >>> turning = torch.zeros(6, 11).double()
        >>> turning[3, 5] = 0.3  # one of three real flights turns in one band
        >>> found = by_own_turns(example_flights(), turning, torch.arange(6) > 2)
        >>> bool(found[3, 5] > 0.04), bool(found[4, 5] < 0), bool((found[:3] == 0).all())
        (True, True, True)
    """
    change = log_rate(state, induced=1 + turning.nan_to_num(0.0)) - state.own_log_rate
    change = torch.where(turning.isfinite(), change, torch.nan)
    for side in (real, ~real):
        change[side] = change[side] - change[side].nanmean(0)
    return change.nan_to_num(0.0)
