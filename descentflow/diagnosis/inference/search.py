"""The search for the parameters at which effects are most likely: score-test gain, windows, ascent."""

from collections.abc import Mapping, Sequence

import torch
from torch import Tensor

from descentflow.diagnosis.inference.ascent import ascend
from descentflow.diagnosis.inference.heterogeneity import with_heterogeneity
from descentflow.diagnosis.inference.likelihood import EffectsLikelihood, Fit
from descentflow.diagnosis.inference.linear_algebra import solve
from descentflow.diagnosis.inference.mixed_fit import with_flight_laws
from descentflow.diagnosis.inference.window_search import FIRST_SIZE, SECANTS, band_columns, best_window

MIN_OTHER_WINDOW_GAIN = 0.5
"""Nats of log-likelihood by which another window must be better for a fit to go on from there. Set by hand; a search
ends after one window more where it is smaller, and nothing that is named depends on half a nat."""


def fit_effects(
    likelihood: EffectsLikelihood, effects: Sequence[str], start: Mapping[str, Tensor] | None = None
) -> Fit:
    """Fit effects together.

    Args:
        likelihood: Of the flights.
        effects: Their names; none for the fit of mean and habits alone.
        start: Parameters to start from; windows without any are searched for.

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
            theta[name] = first_guess(likelihood, name, theta)
    theta = {name: theta[name] for name in effects}
    if not any(likelihood.has_law(name, value) for name, value in theta.items()):
        # Laws are learnt from flights one by one, and what is beside them is fitted with them.
        theta = ascend(likelihood, theta)
    for name in start or ():
        if name in theta and not likelihood.has_law(name, theta[name]):
            # Beside other effects another window may be the best.
            theta = with_other_window(likelihood, theta, name)
    learnt = with_heterogeneity(likelihood, theta)
    if learnt is not None:
        theta = ascend(likelihood, learnt)
    shift, kept = likelihood.shift(theta), likelihood.kept(lambda: likelihood.design(theta))
    return with_flight_laws(likelihood, Fit(tuple(effects), theta, shift, kept, likelihood.log_score(shift, kept())))


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
    for name in likelihood.catalogue:
        design = likelihood.at_start(name)
        moments, windowed = likelihood.moments(rest, design), likelihood.windowed(name)
        if windowed is not None:
            n_bands = design.n_own
            found[name] = best_window(likelihood, windowed, moments, n_bands, FIRST_SIZE).gain
            continue
        information, gradient = moments.profiled()
        step = solve(information + torch.diag(design.ridge), gradient, information.diagonal())
        q = design.n_common
        base, common = information[:q, :q], gradient[:q]
        plain = solve(base + torch.diag(design.ridge[:q]), common, base.diagonal())
        found[name] = 0.5 * float(gradient @ step - common @ plain)
    return found


def first_guess(likelihood: EffectsLikelihood, name: str, known: Mapping[str, Tensor]) -> Tensor:
    """Parameters (k,) from which an effect's fit starts beside known ones: a windowed one in its best window.

    Example:
        >>> from descentflow.diagnosis.inference.example_sides import example_likelihood
        >>> from descentflow.effects import EFFECTS
        >>> likelihood = example_likelihood(EFFECTS["speed_brake"], [0.3, 200, 240, 1, 0, 0, 0, 0])
        >>> first_guess(likelihood, "speed_brake", {})[:3].round(decimals=1)
        tensor([  0.3000, 199.5000, 240.5000], dtype=torch.float64)
    """
    windowed, theta = likelihood.windowed(name), likelihood.start_of(name)
    if windowed is None:
        return theta
    rest = likelihood.weighted_rest(likelihood.shift(known))
    # Beside it the others may move, and so may what else it has: a window must not explain what they would.
    beside = [likelihood.real_jacobian(other, value) for other, value in {**known, name: theta}.items()]
    size = FIRST_SIZE
    for _ in range(SECANTS):
        bands = band_columns(likelihood, windowed, size, likelihood.real_state)
        moments = likelihood.moments(rest, likelihood.with_common(*beside, bands))
        window = best_window(likelihood, windowed, moments, bands.shape[2], size)
        size = min(window.size, windowed.parameters[0].high)
    return windowed.clamp(windowed.at_window(theta, size, window.low_fl, window.high_fl))


def with_other_window(likelihood: EffectsLikelihood, theta: dict[str, Tensor], name: str) -> dict[str, Tensor]:
    """Parameters with the best window of a windowed effect beside the others, where that leads higher.

    Example:
        >>> from descentflow.diagnosis.inference.example_sides import example_likelihood
        >>> from descentflow.effects import EFFECTS
        >>> likelihood = example_likelihood(EFFECTS["speed_brake"], [0.3, 200, 240, 1, 0, 0, 0, 0])
        >>> elsewhere = torch.tensor([0.1, 280, 320, 1, 0, 0, 0, 0]).double()
        >>> found = with_other_window(likelihood, {"speed_brake": elsewhere}, "speed_brake")["speed_brake"]
        >>> found[1:3].round(decimals=-1)
        tensor([200., 240.], dtype=torch.float64)
    """
    if likelihood.windowed(name) is None:
        return theta
    others = {other: value for other, value in theta.items() if other != name}
    value = likelihood.log_likelihood(likelihood.shift(theta))
    found = ascend(likelihood, {**theta, name: first_guess(likelihood, name, others)})
    better = likelihood.log_likelihood(likelihood.shift(found)) > value + MIN_OTHER_WINDOW_GAIN
    return found if better else theta


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
    return likelihood.moved(fit.theta, moments.solved()[1][fit.design.parameters])
