"""When an effect alone is named: what the smallest size that would be named is held against."""

import math

import torch
from torch import Tensor

from descentflow.diagnosis.inference.credible import MIN_MEAN_SHIFT
from descentflow.diagnosis.inference.inclusion import NAMED
from descentflow.diagnosis.inference.set_search import LOG_PRIOR_ODDS


def named_alone(gain: Tensor, error: Tensor, shift: Tensor) -> Tensor:
    """Whether an effect is named (d,) by its gains (d,), their standard errors, and its largest mean shift (d,).

    Its weight against no effect is the mean of a logistic function over the scatter of the gain, here with MacKay's
    approximation (1992, Neural Computation 4, section 4.1).

    Args:
        gain: Nats over no effect, held out.
        error: Standard error of that, by whole aircraft.
        shift: Largest mean shift of an entry, in negligible shifts.

    Example:
        >>> named_alone(torch.tensor([9.0, 2.0, 9.0]), torch.tensor([3.0, 1.0, 3.0]), torch.tensor([9.0, 9.0, 1.0]))
        tensor([ True, False, False])
    """
    weight = torch.sigmoid((gain + LOG_PRIOR_ODDS) / (1 + math.pi * error**2 / 8).sqrt())
    return (weight >= NAMED) & (shift >= MIN_MEAN_SHIFT)


def least_shifts(negligible: Tensor, rounding: Tensor) -> Tensor:
    """Unit (p,) of mean shifts for :func:`named_alone` by which one that a report's rounding hides is not named either.

    Example:
        >>> least_shifts(torch.tensor([0.002, 0.5]), torch.tensor([0.006, 0.3]))
        tensor([0.0040, 0.5000])
    """
    return torch.maximum(negligible, rounding / MIN_MEAN_SHIFT)
