"""Kinds of quantities, statistics and parts of the grid; the entries are in the score registry."""

from collections.abc import Callable
from dataclasses import dataclass

import torch
from torch import Tensor

from descentflow.evaluation.metrics.descent_set import DescentSet
from descentflow.evaluation.metrics.distances import Pooled, Values, error_of_the_mean
from descentflow.evaluation.metrics.proper import energy_scores, joint_energy_scores


@dataclass(frozen=True)
class DescentQuantity:
    """Compared values and mask of a set of descents, in the units of the field.

    Attributes:
        name: In files and code.
        label: In figures and tables.
        short: The label where there is little room.
        unit: Of the values.
        of: Values and mask (n, K) of n descents.
        by_level: Whether K counts the levels; else there is one value for each descent.

    Example:
        >>> drag_kn = lambda descents: (descents.drag_n / 1000, descents.mask)
        >>> drag = DescentQuantity("drag", "Drag", "drag", "kN", drag_kn)
        >>> from descentflow.evaluation.metrics.score_registry import parts_of
        >>> [part.name for part in parts_of(drag)]
        ['drag_above_transition', 'drag_below_transition']
    """

    name: str
    label: str
    short: str
    unit: str
    of: Callable[[DescentSet], Values]
    by_level: bool = True


@dataclass(frozen=True)
class Statistic:
    """Base of all kinds of statistic: a distance of samples from real flights.

    Attributes:
        name: In files and code.
        label: In figures and tables.
        short: The label where there is little room.
        unit: Of the statistic; None for that of the quantity.
        has_floor: Whether it is compared with its noise floor (flights against other flights, as many).
        additive: Whether the part above the floor is a difference, as of proper scores, to which noise adds nothing on
            average; of a distance it is the root of a difference of squares.
        of_one: The statistic of one descent (nominal BADA), with the shape of ``compute``'s result; None if one descent
            has none.
        in_figure: Whether it is drawn by level.
        needs: The fewest flights that a statistic of whole profiles or descents needs, in words.
        most_splits: Most splits behind the matched size and noise floor of one of whole profiles or descents.

    Example:
        >>> from descentflow.evaluation.metrics.score_registry import QUANTITIES, STATISTICS
        >>> cas = QUANTITIES[1]
        >>> STATISTICS["ks"].unit_of(cas), STATISTICS["wasserstein"].unit_of(cas)
        ('1', 'kt')
    """

    name: str
    label: str
    short: str
    unit: str | None = None
    has_floor: bool = True
    additive: bool = False
    of_one: Callable[[Values, Values], Tensor] | None = None
    in_figure: bool = False
    needs: str = "4 flights with samples at all of their levels"
    most_splits: int = 1000

    def unit_of(self, quantity: DescentQuantity) -> str:
        """Unit of the statistic of a quantity."""
        return quantity.unit if self.unit is None else self.unit

    def excess(self, distance: float, floor: float, spread: float) -> float:
        """Excess of a distance over its noise floor, both at one size.

        ``sqrt(max(d^2 - f^2, 0))`` of a distance d with its floor f, as independent errors add up; ``d - f`` of an
        additive statistic, which may fall below zero by chance. In spreads, except for a statistic without a unit.

        Args:
            distance: Of the samples.
            floor: Of other flights.
            spread: Standard deviation of the flights, in the statistic's unit.

        Example:
            >>> from descentflow.evaluation.metrics.score_registry import STATISTICS
            >>> STATISTICS["wasserstein"].excess(5.0, 3.0, spread=8.0), STATISTICS["ks"].excess(0.5, 0.3, spread=8.0)
            (0.5, 0.4)
        """
        above = distance - floor if self.additive else max(distance**2 - floor**2, 0.0) ** 0.5
        return above if self.unit == "1" else above / spread


@dataclass(frozen=True)
class LevelStatistic(Statistic):
    """A statistic at every level: ``compute`` takes samples (first) and flights (second) pooled, and gives (K,).

    Example:
        >>> from descentflow.evaluation.metrics.distances import pool
        >>> bias = LevelStatistic("bias", "bias", "bias", compute=lambda p: (p.mean_first - p.mean_second)[:, 0])
        >>> one, two = torch.tensor([[1.0]]), torch.tensor([[3.0]])
        >>> bias.compute(pool(one, one > 0, two, two > 0))
        tensor([-2.], dtype=torch.float64)
    """

    compute: Callable[[Pooled], Tensor] = error_of_the_mean


@dataclass(frozen=True)
class ProfileStatistic(Statistic):
    """A statistic of whole profiles: ``compute`` takes samples and m flights, and gives one number a flight (m,).

    Flights that cannot be scored are NaN; the score is the mean over the others.

    Example:
        >>> from descentflow.evaluation.metrics.score_registry import STATISTICS
        >>> samples, real = torch.zeros(9, 3), torch.ones(2, 3)
        >>> STATISTICS["energy"].compute((samples, samples == 0), (real, real == 1))
        tensor([1., 1.], dtype=torch.float64)
    """

    compute: Callable[[Values, Values], Tensor] = energy_scores


@dataclass(frozen=True)
class DescentStatistic(Statistic):
    """A statistic of whole descents, all quantities together: ``compute`` takes two sets and gives one number a flight.

    Flights that cannot be scored are NaN; the score is the mean over the others.

    Attributes:
        costly: Whether it is left out where scores are wanted often: while a model trains, and of corrected simulators.

    Example:
        >>> from descentflow.evaluation.metrics.score_registry import STATISTICS
        >>> STATISTICS["auc"].costly, STATISTICS["joint_energy"].costly
        (True, False)
    """

    compute: Callable[[DescentSet, DescentSet], Tensor] = joint_energy_scores
    costly: bool = False


@dataclass(frozen=True)
class LevelPart:
    """Levels of a quantity over which the rows of the table average.

    Attributes:
        name: In files: the quantity's, with ``_above_transition``, ``_below_transition`` or ``_profile``.
        label: In tables.
        short: The label where there is little room.
        side: ``above``, ``at or below``, or nothing.

    Example:
        >>> from descentflow.evaluation.metrics.score_registry import level_parts
        >>> above = level_parts()["cas_above_transition"]
        >>> above.levels(torch.tensor([280.0, 290.0, 300.0]), transition_fl=290.0)
        tensor([False, False,  True])
    """

    quantity: DescentQuantity
    name: str
    label: str
    short: str
    side: str = ""

    def levels(self, levels_fl: Tensor, transition_fl: float) -> Tensor:
        """Mask (K,) of the quantity's values that belong to the part."""
        if not self.quantity.by_level:
            return torch.ones(1, dtype=torch.bool, device=levels_fl.device)
        above = levels_fl > transition_fl
        return above if self.side == "above" else ~above
