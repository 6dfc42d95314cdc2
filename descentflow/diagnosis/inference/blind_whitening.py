"""The precision for tests by permutation: it knows neither the sides nor the flights that it weighs."""

import torch
from torch import Tensor

from descentflow.diagnosis.inference.aircraft_groups import blind_folds
from descentflow.diagnosis.inference.two_sides import Compared
from descentflow.diagnosis.inference.whitening import Whitening, whiten

MIN_PAIR = 2
"""Flights by which an aircraft says what its flights share."""


def blind_whitening(compared: Compared, seed: int) -> Whitening:
    """Each aircraft's precision as the flights of other aircraft say it, of both sides together.

    A covariance that is learnt from the flights themselves weighs most the directions in which they happen to scatter
    least. Few aircraft of many flights decide most of it: in just these directions their own scatter, by which a score
    is judged, is then too small, and where they are all on one side, the true labelling stands out without a gap. So
    each fold is weighed by what the others say, and no aircraft says it by more flights than the median one has (two
    at least, for what flights of an aircraft share shows in pairs).

    Of Gaussian nulls with 20 aircraft of 20 flights against 40 of 5, 5.0 % of 600 were called at 2 % with a covariance
    of the flights' own, 4.3 % of 400 with folds, and 2.5 % of 400 with both.

    Args:
        compared: Flights of both sides.
        seed: By which aircraft are dealt to folds.

    Example:
        >>> from descentflow.diagnosis.inference.example_sides import example_sides
        >>> sides = example_sides()
        >>> weights = blind_whitening(sides, seed=0)
        >>> weights.apply(sides.y).shape, len(weights.precision)  # five folds, one pattern of what is seen
        (torch.Size([160, 33]), 5)
    """
    everyone, fold = torch.ones_like(compared.real), blind_folds(compared.airframe, seed)
    _, index, counts = torch.unique(compared.airframe, return_inverse=True, return_counts=True)
    learn = _number_in_aircraft(index) < max(MIN_PAIR, int(counts.median()))
    return whiten(compared.y, everyone, compared.airframe, compared.nugget(), compared.of_flight(), learn, fold)


def _number_in_aircraft(index: Tensor) -> Tensor:
    """How many flights (n,) of the same aircraft (n,) come before each."""
    order = index.argsort(stable=True)
    counts = torch.bincount(index)
    before = torch.arange(len(index)) - (counts.cumsum(0) - counts)[index[order]]
    return torch.empty_like(before).index_copy_(0, order, before)
