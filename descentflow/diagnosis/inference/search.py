"""The search for the parameters at which effects are most likely: score-test gain, ascent, neighbour search."""

from collections.abc import Mapping, Sequence

import torch
from torch import Tensor

from descentflow.diagnosis.inference.heterogeneity import with_heterogeneity
from descentflow.diagnosis.inference.likelihood import EffectsLikelihood, Fit
from descentflow.diagnosis.inference.linear_algebra import solve

MAX_STEPS = 5
"""Gauss-Newton steps of an ascent; effects are close to linear in their parameters, so two or three suffice."""
STEP_FACTORS = (1.0, 0.4, 0.1)
"""A step is shortened by these until it leads higher."""
MIN_STEP_GAIN = 0.03
"""Nats of log-likelihood below which an ascent ends: far less than any rule of the selection looks at. Set by hand."""
MIN_NEIGHBOUR_GAIN = 0.5
"""Nats of log-likelihood by which a neighbour must be better for a fit to go on from there: less is no other window.
Set by hand."""
MIN_SIZE = 0.02
"""A fit from the best of several starts begins with at least so much of the first parameter: at zero, where a window
lies cannot be felt."""


def fit_effects(
    likelihood: EffectsLikelihood, effects: Sequence[str], start: Mapping[str, Tensor] | None = None
) -> Fit:
    """Fit effects together.

    Args:
        likelihood: Of the flights.
        effects: Their names; none for the fit of mean and habits alone.
        start: Parameters to start from; where an effect has several starts, the one of the largest score-test gain is
            taken.

    Example:
        >>> from descentflow.diagnosis.inference.example_sides import example_likelihood
        >>> from descentflow.effects import EFFECTS
        >>> likelihood = example_likelihood(EFFECTS["temperature"], [10.0])
        >>> fit = fit_effects(likelihood, ["temperature"])
        >>> fit.theta["temperature"].round()
        tensor([10.], dtype=torch.float64)
    """
    theta: dict[str, Tensor] = {name: start[name] for name in effects if start and name in start}
    for name in effects:
        if name not in theta:
            theta[name] = best_start(likelihood, name, theta)
    theta = neighbour_search(likelihood, ascend(likelihood, {name: theta[name] for name in effects}))
    learnt = with_heterogeneity(likelihood, theta)
    if learnt is not None:
        theta = ascend(likelihood, learnt)
    shift, design = likelihood.shift(theta), likelihood.design(theta)
    return Fit(tuple(effects), theta, shift, design, likelihood.log_score(shift, design))


def score_test_gain(likelihood: EffectsLikelihood, shift: Tensor) -> dict[str, float]:
    """Gain (nats) in likelihood by effect that its sensitivity alone lets expect beside a shift (Rao's score test).

    It is not held out, and costs no fit: effects that gain nothing by it are not fitted at all.

    Example:
        >>> from descentflow.diagnosis.inference.example_sides import example_likelihood
        >>> from descentflow.effects import EFFECTS
        >>> likelihood = example_likelihood(EFFECTS["temperature"], [10.0])
        >>> gain = score_test_gain(likelihood, torch.zeros_like(likelihood.y))
        >>> max(gain, key=gain.get)
        'temperature'
    """
    rest, found = likelihood.weighted_rest(shift), {}
    for name, design in likelihood.starts.items():
        information, gradient = likelihood.moments(rest, design).profiled()
        own = slice(design.n_common, None)
        if len(likelihood.starts_of(name)) > 1:
            gain = 0.5 * gradient[own].clamp(min=0.0) ** 2 / information.diagonal()[own].clamp(min=1e-12)
            found[name] = float(gain.max())
            continue
        step = solve(information + torch.diag(design.ridge), gradient, information.diagonal())
        without = design.common()
        base, common = information[: without.n_common, : without.n_common], gradient[: without.n_common]
        plain = solve(base + torch.diag(without.ridge), common, base.diagonal())
        found[name] = 0.5 * float(gradient @ step - common @ plain)
    return found


def best_start(likelihood: EffectsLikelihood, name: str, known: Mapping[str, Tensor]) -> Tensor:
    """Where a fit of an effect starts beside known ones: of several starts, that of the largest score-test gain.

    Example:
        >>> from descentflow.diagnosis.inference.example_sides import example_likelihood
        >>> from descentflow.effects import EFFECTS
        >>> likelihood = example_likelihood(EFFECTS["temperature"], [10.0])
        >>> best_start(likelihood, "temperature", {})
        tensor([0.], dtype=torch.float64)
    """
    starts = likelihood.starts_of(name)
    if len(starts) == 1:
        return starts[0]
    design = likelihood.starts[name]
    rest = likelihood.weighted_rest(likelihood.shift(known))
    information, whole = likelihood.moments(rest, design).profiled()
    size = information.diagonal()[design.n_common :].clamp(min=1e-12)
    gradient = whole[design.n_common :]
    best = int((gradient.clamp(min=0.0) ** 2 / size).argmax())
    begun = starts[best].clone()
    begun[0] = (gradient / size)[best].clamp(min=MIN_SIZE)
    return likelihood.catalogue[name].clamp(begun)


def ascend(likelihood: EffectsLikelihood, theta: dict[str, Tensor]) -> dict[str, Tensor]:
    """Parameters after Gauss-Newton steps uphill, each shortened until it leads higher.

    Example:
        >>> from descentflow.diagnosis.inference.example_sides import example_likelihood
        >>> from descentflow.effects import EFFECTS
        >>> likelihood = example_likelihood(EFFECTS["temperature"], [10.0])
        >>> ascend(likelihood, {"temperature": torch.tensor([0.0]).double()})["temperature"].round()
        tensor([10.], dtype=torch.float64)
    """
    value = likelihood.log_likelihood(likelihood.shift(theta))
    for _ in range(MAX_STEPS if theta else 0):
        step = gauss_newton_step(likelihood, theta)
        gained = 0.0
        for factor in STEP_FACTORS:
            trial = likelihood.moved(theta, factor * step)
            gained = likelihood.log_likelihood(likelihood.shift(trial)) - value
            if gained > 0:
                theta, value = trial, value + gained
                break
        if gained < MIN_STEP_GAIN:
            break
    return theta


def gauss_newton_step(likelihood: EffectsLikelihood, theta: Mapping[str, Tensor]) -> Tensor:
    """Step (k,) of all parameters together to the best of the likelihood, were it quadratic.

    Example:
        >>> from descentflow.diagnosis.inference.example_sides import example_likelihood
        >>> from descentflow.effects import EFFECTS
        >>> likelihood = example_likelihood(EFFECTS["temperature"], [10.0])
        >>> gauss_newton_step(likelihood, {"temperature": torch.tensor([0.0]).double()}).round()
        tensor([10.], dtype=torch.float64)
    """
    design = likelihood.design(theta)
    rest = likelihood.weighted_rest(likelihood.shift(theta))
    return likelihood.moments(rest, design).solved()[1][design.n_common :]


def neighbour_search(likelihood: EffectsLikelihood, theta: dict[str, Tensor]) -> dict[str, Tensor]:
    """Go on from the best neighbour where that leads higher, until none does.

    Example:
        >>> from descentflow.diagnosis.inference.example_sides import example_likelihood
        >>> from descentflow.effects import EFFECTS
        >>> likelihood = example_likelihood(EFFECTS["temperature"], [10.0])
        >>> theta = {"temperature": torch.tensor([10.0]).double()}
        >>> neighbour_search(likelihood, theta) == theta  # an effect without windows has no neighbours
        True
    """
    for name in theta:
        better = True
        while better:
            value = likelihood.log_likelihood(likelihood.shift(theta))
            tried = [{**theta, name: beside} for beside in likelihood.catalogue[name].neighbours(theta[name])]
            if not tried:
                break
            # Both ends of a window may have to move: the neighbour itself need not be better than where it is.
            best = max(tried, key=lambda trial: likelihood.log_likelihood(likelihood.shift(trial)))
            ascended = ascend(likelihood, best)
            better = likelihood.log_likelihood(likelihood.shift(ascended)) > value + MIN_NEIGHBOUR_GAIN
            theta = ascended if better else theta
    return theta


def parameters_of_part(likelihood: EffectsLikelihood, fit: Fit, keep: Tensor) -> dict[str, Tensor]:
    """Parameters that the flights to keep (n,) alone would give, one step from the fit.

    Example:
        >>> from descentflow.diagnosis.inference.example_sides import example_likelihood
        >>> from descentflow.effects import EFFECTS
        >>> likelihood = example_likelihood(EFFECTS["temperature"], [10.0])
        >>> fit = fit_effects(likelihood, ["temperature"])
        >>> parameters_of_part(likelihood, fit, torch.arange(160) % 2 == 0)["temperature"].round()
        tensor([10.], dtype=torch.float64)
    """
    moments = likelihood.moments(likelihood.weighted_rest(fit.shift), fit.design, keep)
    return likelihood.moved(fit.theta, moments.solved()[1][fit.design.n_common :])
