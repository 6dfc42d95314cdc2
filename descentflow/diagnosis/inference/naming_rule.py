"""When an effect alone is named: what the smallest size that would be named is held against."""

from torch import Tensor

from descentflow.diagnosis.inference.selection_rules import MIN_GAIN, MIN_GAIN_Z, MIN_MEAN_SHIFT


def named_alone(gain: Tensor, error: Tensor, shift: Tensor) -> Tensor:
    """Whether an effect is named (d,) by its gains (d,), their standard errors, and its largest mean shift (d,).

    Args:
        gain: Nats over no effect, held out.
        error: Standard error of that, by whole aircraft.
        shift: Largest mean shift of an entry, in negligible shifts.

    Example:
        >>> import torch
        >>> named_alone(torch.tensor([9.0, 9.0, 9.0]), torch.tensor([3.0, 6.0, 3.0]), torch.tensor([9.0, 9.0, 1.0]))
        tensor([ True, False, False])
    """
    return (gain >= MIN_GAIN) & (gain >= MIN_GAIN_Z * error) & (shift >= MIN_MEAN_SHIFT)
