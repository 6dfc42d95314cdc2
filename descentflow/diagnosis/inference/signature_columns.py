r"""How an effect's signature may be off: by the aircraft's coefficients, and by what its equations miss.

Both are columns of every fit, with a normal prior of unit spread on their coefficients, for the real flights alone:

.. math:: y_i = m + \sum_e d_{ie}(\theta_e) + \sum_j a_j \frac{\partial}{\partial u_j} \sum_e d_{ie}
          + \sum_{e, q, k} \varepsilon_q b_{eqk} \, h_k \, d_{ieq}(\theta_e) + \epsilon_i, \qquad a, b \sim N(0, 1),

with :math:`u` the coefficients of the reference aircraft in standard deviations of what is known of them and
:math:`h_k` hat functions over altitude. Both grow with the effect itself. So effects that differ by less than their own
signatures are uncertain are one group by themselves, and what a large effect leaves of itself names no second one.
"""

from collections.abc import Mapping
from typing import Protocol

import torch
from torch import Tensor

from descentflow.diagnosis.inference.two_sides import Compared
from descentflow.measurements.quantity_registry import BY_BAND

MISFIT = 0.03
"""Share of its own shift by which an effect's equations may be off, at each knot and in each quantity by itself. Of its
shift of the rate, which rests on a polar, an idle thrust and steady forces and not on kinematics, each effect says its
own (:attr:`~descentflow.effects.effect.Effect.misfit_of_rate`)."""
KNOTS = 3
"""Hat functions over altitude: smoother than any window, so that no edge passes for a misfit."""
FELT = 0.3
"""Columns that move no entry by more than so many negligible shifts are left out, to save time."""


class Shifts(Protocol):
    """What effects shift, and by how much that may be off."""

    compared: Compared

    def misfits(self, name: str, theta: Tensor) -> tuple[Tensor, Tensor]:
        """Mean shifts (9, p) of an effect, and the columns (p, c) by which the first may be off."""
        ...


def signature_columns(shifts: Shifts, theta: Mapping[str, Tensor]) -> Tensor:
    """Columns (p, c) by which the mean effects at these parameters may be off, with unit prior spread.

    Example:
        >>> from descentflow.diagnosis.inference.example_sides import example_likelihood
        >>> from descentflow.effects import EFFECTS
        >>> likelihood = example_likelihood(EFFECTS["temperature"], [10.0])
        >>> small, large = (signature_columns(likelihood, {"mass": torch.tensor([x]).double()}) for x in (0.05, 0.1))
        >>> 1.5 < float(large.abs().max() / small.abs().max()) < 2.5  # they grow with the effect
        True
    """
    compared = shifts.compared
    if not theta:
        return torch.zeros(len(compared.entries), 0, dtype=torch.float64)
    means, misfits = zip(*(shifts.misfits(name, value) for name, value in theta.items()), strict=True)
    above, below = torch.stack(means).sum(0)[1:].reshape(2, 4, -1)
    columns = torch.cat([(above - below).T / 2, *misfits], 1)
    return columns[:, (columns.abs() / compared.negligible()[:, None]).amax(0) > FELT]


def misfit_columns(compared: Compared, shift: Tensor, of_rate: float) -> Tensor:
    """Columns (p, c) of a mean shift's (p,) own misfit: a share of it, smooth in altitude, quantity by quantity.

    They span no multiple of the whole shift: how large an effect is stays with its parameters.

    Args:
        compared: Flights of both sides.
        shift: (p,) mean shift.
        of_rate: Share of the rate's shift, see :func:`misfit_of`.

    Example:
        >>> from descentflow.diagnosis.inference.example_sides import example_sides
        >>> sides = example_sides()
        >>> columns = misfit_columns(sides, sides.negligible(), of_rate=0.5)
        >>> known_to = torch.tensor([misfit_of(entry.quantity, 0.5) for entry in sides.entries]) * sides.negligible()
        >>> along_shift = (columns * (sides.negligible() / known_to**2)[:, None]).sum(0)
        >>> columns.shape, bool((along_shift.abs() < 1e-9).all())
        (torch.Size([33, 9]), True)
    """
    columns = [torch.zeros(0, len(shift), dtype=shift.dtype)]
    for quantity in compared.quantities():
        at = compared.columns(quantity)
        if bool((shift[at] != 0).any()):
            hat = _hats(compared, quantity, at)
            column = torch.zeros(len(hat), len(shift), dtype=shift.dtype)
            column[:, at] = misfit_of(quantity, of_rate) * hat * shift[at]
            columns.append(column)
    found = torch.cat(columns).T
    # How large an effect is stays with its parameters: what is a multiple of the whole shift is taken out, each
    # quantity weighed by how well its equations hold. Else the rate, which may be off by half, would outweigh TAS.
    known_to = torch.tensor([misfit_of(entry.quantity, of_rate) for entry in compared.entries]) * compared.negligible()
    weighted = shift / known_to**2
    return found - torch.outer(shift, weighted @ found) / (weighted @ shift).clamp(min=1e-12)


def misfit_of(quantity: str, of_rate: float) -> float:
    """Share of its own shift of a quantity by which an effect's equations may be off; of the rate its own.

    Example:
        >>> misfit_of("rate", 0.5), misfit_of("tas", 0.5)
        (0.5, 0.03)
    """
    return of_rate if quantity == "rate" else MISFIT


def _hats(compared: Compared, quantity: str, at: Tensor) -> Tensor:
    if quantity not in BY_BAND:
        return torch.ones(1, len(at), dtype=torch.float64)
    levels = compared.state.altitude_m
    return hats(levels[[compared.entries[i].band for i in at.tolist()]], KNOTS, levels)


def hats(altitude_m: Tensor, count: int, levels_m: Tensor) -> Tensor:
    """Hat functions (count, k) at altitudes (k,) that add up to one, their knots spread over levels.

    Example:
        >>> levels = torch.linspace(4e3, 12e3, 5).double()
        >>> hats(levels, 3, levels)
        tensor([[1.0000, 0.5000, 0.0000, 0.0000, 0.0000],
                [0.0000, 0.5000, 1.0000, 0.5000, 0.0000],
                [0.0000, 0.0000, 0.0000, 0.5000, 1.0000]], dtype=torch.float64)
    """
    low, high = float(levels_m[0]), float(levels_m[-1])
    if count < 2 or high <= low:
        return torch.ones(1, len(altitude_m), dtype=torch.float64)
    knots = torch.linspace(low, high, count, dtype=torch.float64)
    return (1 - (altitude_m - knots[:, None]).abs() / float(knots[1] - knots[0])).clamp(min=0.0)
