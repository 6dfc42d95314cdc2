"""Scores of `evaluate` before and after: causes fitted on half of the real flights, evaluated on the other half.

Aircraft of the real flights are dealt into two halves. Parameters that one half gives are put into the simulator's own
flights, which are scored against the other half, and the other way about; the mean of both is reported, beside the
noise floor: one half of those flights against the other, at the same size.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from math import isnan

import torch
from torch import Tensor

from descentflow.core.units import FPM_MPS, KT_MPS
from descentflow.diagnosis.findings.correction_found import Score
from descentflow.evaluation.metrics.descent_set import DescentSet
from descentflow.evaluation.metrics.score_registry import rows
from descentflow.evaluation.metrics.score_table import ScoreTable
from descentflow.evaluation.metrics.scores import score
from descentflow.measurements.level_channels import LevelGrid

N_SPLITS = 6
"""Halvings behind each score and its floor, the same ones for all that is compared."""
MOST = 400
"""Flights of either side that are scored at most: means over these are known to a twentieth of their spread."""
NEEDED = ("IAS", "vertical_rate")
"""Channels that are scored."""

Corrected = Callable[[Mapping[str, Tensor]], DescentSet]
"""The simulator's flights with effects of given parameters in them."""
Tables = dict[str, ScoreTable]
"""Before and after, and with each cause alone."""


@dataclass(frozen=True)
class Halves:
    """Real flights in two halves of whole aircraft, each scored by what the other gives.

    Attributes:
        flights: The real flights of either half.
        theta: The parameters that either half gives.

    Example:
        >>> from descentflow.measurements.quantities import grid_of
        >>> from descentflow.surveillance.descents.prepared_descents import read_descents
        >>> grid = grid_of(read_descents("descents.parquet").frame, 150, 340, NEEDED)
        >>> real = descents_of(grid)
        >>> Halves((real, real), ({}, {})).flights[0].mask.shape
        torch.Size([120, 191])
    """

    flights: tuple[DescentSet, DescentSet]
    theta: tuple[Mapping[str, Tensor], Mapping[str, Tensor]]


def descents_of(grid: LevelGrid) -> DescentSet:
    """Flights on levels as scores take them; drag is not scored.

    Example:
        >>> from descentflow.measurements.quantities import grid_of
        >>> from descentflow.surveillance.descents.prepared_descents import read_descents
        >>> len(descents_of(grid_of(read_descents("descents.parquet").frame, 150, 340, NEEDED)))
        120
    """
    mask = grid.mask

    def shown(values: Tensor) -> Tensor:
        return torch.where(mask, values, 0.0)

    return DescentSet(
        grid.levels_fl,
        shown(grid.time_s),
        shown(grid.values["IAS"] * KT_MPS),
        shown(grid.values["vertical_rate"] * FPM_MPS),
        torch.zeros_like(grid.time_s),
        mask,
    )


@dataclass(frozen=True)
class Scoring:
    """Scores that are still to be computed.

    Attributes:
        calls: Each computes the tables of one half of the real flights, scored by what the other gives.
        alone: Causes that are scored by themselves too, where there are several.

    Example:
        >>> Scoring().rows([])  # of no causes
        []
    """

    calls: tuple[Callable[[], Tables], ...] = ()
    alone: tuple[str, ...] = ()

    def rows(self, found: Sequence[Tables]) -> list[Score]:
        """Means over both halves of what the calls gave; scores that have too few flights in either are left out."""
        told = []
        for part, statistic in rows() if found else []:
            tables = [{key: table.get(part.name, statistic.name) for key, table in one.items()} for one in found]

            def mean(key: str, field: str, tables: list[dict[str, object]] = tables) -> float:  # type: ignore[assignment]
                return sum(float(getattr(one[key], field)) for one in tables) / len(tables)

            before, after, floor = mean("before", "equal_size"), mean("after", "equal_size"), mean("before", "floor")
            if isnan(before) or isnan(after):
                continue
            each = {name: mean(name, "equal_size") for name in self.alone}
            label = f"{part.label[0].lower()}{part.label[1:]}" if not part.label.startswith("CAS") else part.label
            name = f"{label}, {statistic.label}"
            unit = statistic.unit_of(part.quantity)
            told.append(Score(name, unit, before, after, None if isnan(floor) else floor, each))
        return told


def scoring(halves: Halves, before: DescentSet, corrected: Corrected, transition_fl: float, seed: int) -> Scoring:
    """Every score before and after the causes, all together and each alone, beside the noise floor.

    Args:
        halves: Real flights.
        before: The simulator's own.
        corrected: Puts causes into them.
        transition_fl: Transition level of the type.
        seed: Of the halvings: the same for all, so that differences are of the flights.

    Example:
        >>> from descentflow.measurements.quantities import grid_of
        >>> from descentflow.surveillance.descents.prepared_descents import read_descents
        >>> grid = grid_of(read_descents("descents.parquet").frame, 150, 340, NEEDED)
        >>> real = descents_of(grid)
        >>> first = torch.arange(120) < 60
        >>> halves = Halves((real.subset(first), real.subset(~first)), ({}, {}))
        >>> asked = scoring(halves, real, lambda theta: real, transition_fl=290.0, seed=0)
        >>> found = asked.rows([call() for call in asked.calls])
        >>> found[0].name, found[0].unit, found[0].before == found[0].after
        ('time to bottom of descent, KS distance', '1', True)
    """
    names = tuple(halves.theta[0])
    alone = names if len(names) > 1 else ()

    def scored(real: DescentSet, theta: Mapping[str, Tensor]) -> Tables:
        sets = {"before": before, "after": corrected(theta)}
        sets |= {name: corrected({name: theta[name]}) for name in alone}
        # The floor is of the real flights, whatever is set beside them.
        return {
            key: score(one, real, transition_fl, seed=seed, n_splits=N_SPLITS, floor=key == "before")
            for key, one in sets.items()
        }

    return Scoring(tuple(partial(scored, halves.flights[k], halves.theta[1 - k]) for k in (0, 1)), alone)
