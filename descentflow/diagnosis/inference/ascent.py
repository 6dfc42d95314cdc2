"""The ascent to the parameters at which effects together are most likely: Gauss and Newton's steps, shortened."""

from torch import Tensor

from descentflow.diagnosis.inference.likelihood import EffectsLikelihood
from descentflow.diagnosis.inference.linear_algebra import Design

MAX_STEPS = 5
"""Gauss-Newton steps of an ascent; effects are close to linear in their parameters, so two or three suffice."""
STEP_FACTORS = (1.0, 0.4, 0.1)
"""A step is shortened by these until it leads higher."""
MIN_STEP_GAIN = 0.03
"""Nats of log-likelihood below which an ascent ends: far less than any rule of the selection looks at. Set by hand."""


def ascend(likelihood: EffectsLikelihood, theta: dict[str, Tensor]) -> dict[str, Tensor]:
    """Parameters after Gauss-Newton steps uphill, each shortened until it leads higher.

    Example:
        >>> from descentflow.diagnosis.inference.example_sides import example_likelihood
        >>> from descentflow.effects import EFFECTS
        >>> likelihood = example_likelihood(EFFECTS["temperature"], [10.0])
        >>> ascend(likelihood, {"temperature": torch.tensor([0.0]).double()})["temperature"].round()
        tensor([10.], dtype=torch.float64)
    """
    shift = likelihood.shift(theta)
    for _ in range(MAX_STEPS if theta else 0):
        design = likelihood.design(theta)
        # What signatures may be off by changes little within a step.
        beside = design.without_parameters()
        value = likelihood.log_likelihood(shift, beside)
        step = gauss_newton_step(likelihood, shift, design)
        gained = 0.0
        for factor in STEP_FACTORS:
            trial = likelihood.moved(theta, factor * step)
            trial_shift = likelihood.shift(trial)
            gained = likelihood.log_likelihood(trial_shift, beside) - value
            if gained > 0:
                theta, shift = trial, trial_shift
                break
        if gained < MIN_STEP_GAIN:
            break
    return theta


def gauss_newton_step(likelihood: EffectsLikelihood, shift: Tensor, design: Design) -> Tensor:
    """Step (k,) of all parameters together to the best of the likelihood, were it quadratic.

    Example:
        >>> from descentflow.diagnosis.inference.example_sides import example_likelihood
        >>> from descentflow.effects import EFFECTS
        >>> likelihood = example_likelihood(EFFECTS["temperature"], [10.0])
        >>> theta = {"temperature": torch.tensor([0.0]).double()}
        >>> gauss_newton_step(likelihood, likelihood.shift(theta), likelihood.design(theta)).round()
        tensor([10.], dtype=torch.float64)
    """
    return likelihood.moments(likelihood.weighted_rest(shift), design).solved()[1][design.parameters]
