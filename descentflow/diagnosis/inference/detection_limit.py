r"""The smallest size of each effect that would be named in 80 of 100 cases, for these flights and channels.

About no effect the held-out gain is a function of few numbers. With :math:`I` the information of the effect's
parameters, all that flights have in common profiled out, and :math:`V` the variance of their score by whole aircraft,
each of F folds has a score :math:`G_f \sim N(I_f \theta_0, V / F)` where the effect has the parameters
:math:`\theta_0`. The other folds give :math:`\hat\theta_{-f} = (I - I_f)^{-1} \sum_{g \ne f} G_g`, and the gain is

.. math:: \sum_f \hat\theta_{-f}^\top G_f - \tfrac12 \hat\theta_{-f}^\top I_f\, \hat\theta_{-f}.

So a few thousand gains of a size are drawn without a fit, and held against the rule by which effects are named.

It is the mean shift that is felt here. Of an effect that takes some flights and leaves others, what tells these apart
comes on top: its size is an upper bound. Planted at the mean of eight fleets' limits into 100 Gaussian fleets,
temperature, drag, wind and level-offs are named in 93, 77, 81 and 72; one fleet's limit of drag is known to 6 %.
At the limit of one fleet, of 40 a speed schedule was named in 53 % and an airspeed bias in 96 of 100.
"""

from collections.abc import Callable
from dataclasses import dataclass

import torch
from torch import Tensor

from descentflow.diagnosis.findings.gap_found import LargestDifference
from descentflow.diagnosis.findings.selection_found import DetectionLimit
from descentflow.diagnosis.inference.aircraft_groups import FOLDS, by_aircraft
from descentflow.diagnosis.inference.likelihood import EffectsLikelihood, Fit

NAMED_IN = 0.8
"""Share of the cases in which an effect of the size is named."""
DRAWS = 2000
"""Of each size: a share of 80 % is known to one percent, which moves the size by half a percent."""
HALVINGS = 14
"""Of the interval in which the size lies: to one part in 16,000 of the largest that is possible."""
TYPICAL_SHARE = 0.5
"""Of the flights that have an effect which takes some of them, where none was estimated."""
SHOWN = 1e-12
"""Information below which an effect moves nothing that is compared."""

Rule = Callable[[Tensor, Tensor, Tensor], Tensor]
"""Whether an effect is named (d,), by gains (d,) in nats, their standard errors, and the largest mean shift of the
entries in negligible shifts."""


@dataclass(frozen=True)
class LocalPower:
    """What decides how often an effect is named: information (k, k) and variance of the score (k, k).

    Beside them the largest mean shift of an entry, in negligible shifts or what else is the unit, for one unit of the
    first parameter, and the ``least`` size that the effect can have.

    Example:
        >>> strong = LocalPower(torch.tensor([[100.0]]).double(), torch.tensor([[100.0]]).double(), shift=10.0)
        >>> gain, error, _ = strong.draws(torch.tensor([1.0]).double(), seed=0)
        >>> round(float(gain.mean())), round(float(error.mean()))  # half of the squared z of ten, give or take ten
        (49, 10)
    """

    information: Tensor
    variance: Tensor
    shift: float
    least: float = 0.0

    def draws(self, theta: Tensor, seed: int) -> tuple[Tensor, Tensor, Tensor]:
        """Gains (d,), their standard errors by aircraft, and estimates of the size, of an effect at theta (k,)."""
        generator = torch.Generator().manual_seed(seed)
        values, vectors = torch.linalg.eigh(self.variance / FOLDS)
        root = vectors * values.clamp(min=0.0).sqrt()
        noise = torch.randn(DRAWS, FOLDS, len(theta), generator=generator, dtype=torch.float64) @ root.T
        own = self.information / FOLDS
        score = noise + own @ theta
        fitted = torch.linalg.solve(own * (FOLDS - 1), (score.sum(1, keepdim=True) - score).flatten(0, 1).T).T
        fitted = fitted.reshape(score.shape)
        gain = (fitted * score).sum((1, 2)) - 0.5 * (fitted * (fitted @ own)).sum((1, 2))
        mean = fitted.mean(1)
        error = (mean * (mean @ self.variance)).sum(1).clamp(min=0.0).sqrt()
        return gain, error, mean[:, 0]

    def named(self, theta: Tensor, rule: Rule, seed: int = 0) -> float:
        """Share of the cases in which an effect at theta (k,) is named."""
        gain, error, size = self.draws(theta, seed)
        return float((rule(gain, error, size.abs() * self.shift) & (size >= self.least)).double().mean())


@dataclass(frozen=True)
class Scatter:
    """Flights minus a fit and then minus their side's mean, weighted, with what all flights have in common.

    Attributes:
        weighted: (n, p) precision times it.
        gradient: (n, b) of each flight for the free mean and the habits.
        whole: (b, b) information of these.

    Example:
        >>> from descentflow.diagnosis.inference.example_sides import example_likelihood
        >>> Scatter.of(example_likelihood(), fit=None).weighted.shape
        torch.Size([160, 33])
    """

    weighted: Tensor
    gradient: Tensor
    whole: Tensor

    @classmethod
    def of(cls, likelihood: EffectsLikelihood, fit: Fit | None) -> "Scatter":
        """What no effect could be told apart from."""
        left = likelihood.compared.y.clone() if fit is None else likelihood.compared.y - fit.shift
        for side in (likelihood.real, ~likelihood.real):
            if bool(side.any()):
                left[side] = left[side] - left[side].nanmean(0)
        free, common = likelihood.compared.free, likelihood.common
        weighted = likelihood.whitening.apply(left.nan_to_num(0.0))
        gradient = torch.cat([weighted[:, free], torch.einsum("np,npq->nq", weighted, common.columns)], 1)
        base = likelihood.sums.base.sum(0)
        prior = torch.zeros(len(base), dtype=base.dtype)
        prior[int(free.sum()) :] = common.ridge
        return cls(weighted, gradient, base + torch.diag(prior + 1e-9 * base.diagonal() + 1e-300))


def detection_limits(
    likelihood: EffectsLikelihood,
    rule: Rule,
    fit: Fit | None = None,
    seed: int = 0,
    least: Tensor | None = None,
) -> dict[str, DetectionLimit]:
    """Every effect's smallest size that would be named in :data:`NAMED_IN` of the cases.

    What would stand in its place counts as the effect: the size says that it, or its group, is named.

    Args:
        likelihood: Of the flights.
        rule: By which an effect alone is named.
        fit: What is taken off the flights first, for their scatter alone is wanted; nothing if absent.
        seed: Of the draws.
        least: (p,) unit of the mean shifts that the rule is given; negligible shifts if absent.

    Example:
        >>> from descentflow.diagnosis.inference.example_sides import example_likelihood
        >>> likelihood = example_likelihood()
        >>> rule = lambda gain, error, shift: (gain > 4) & (gain > 2 * error) & (shift > 1.5)
        >>> limits = detection_limits(likelihood, rule)
        >>> round(limits["temperature"].size), limits["temperature"].unit, limits["measurement_noise"].size
        (1, 'K', None)
    """
    scatter = Scatter.of(likelihood, fit)
    unit = likelihood.compared.negligible() if least is None else least

    return {name: _limit(likelihood, name, rule, fit, scatter, unit, seed) for name in likelihood.catalogue}


def _limit(
    likelihood: EffectsLikelihood, name: str, rule: Rule, fit: Fit | None, scatter: Scatter, unit: Tensor, seed: int
) -> DetectionLimit:
    share = _share_of(likelihood, name, fit)
    start = _without_effect(likelihood, name, share)
    at = _size_of(likelihood, name, start)
    parameter = likelihood.catalogue[name].parameters[at]
    power = local_power(likelihood, name, start, at, scatter, unit)
    size = None if power is None or parameter.high <= 0.0 else _smallest(power, rule, parameter.high, seed)
    told = size if size is None or share is None else size / share
    return DetectionLimit(
        effect=name,
        parameter=parameter.name,
        size=None if told is None else parameter.told(told),
        unit=parameter.told_unit,
        label=parameter.text,
        share=share,
        shows=None if size is None else _shows(likelihood, name, _with_size(start, at, size)),
    )


def local_power(
    likelihood: EffectsLikelihood, name: str, start: Tensor, at: int, scatter: Scatter, unit: Tensor
) -> LocalPower | None:
    """Information and variance of an effect about no effect; None where it shows nowhere.

    Args:
        likelihood: Of the flights.
        name: Of the effect.
        start: Parameters (k,) without the effect.
        at: Which of them is its size.
        scatter: Of the flights.
        unit: (p,) of mean shifts.

    Example:
        >>> from descentflow.diagnosis.inference.example_sides import example_likelihood
        >>> likelihood = example_likelihood()
        >>> unit = likelihood.compared.negligible()
        >>> scatter = Scatter.of(likelihood, fit=None)
        >>> power = local_power(likelihood, "temperature", torch.zeros(1).double(), 0, scatter, unit)
        >>> 5 < float(power.information) < 500  # of one kelvin
        True
    """
    columns = _columns(likelihood, name, start, at)
    found, real = likelihood.sums.of_columns(likelihood.with_common(columns)), likelihood.real
    cross = found.cross.sum(0)
    held = torch.linalg.solve(scatter.whole, cross) if len(cross) else cross
    information = found.inner.sum(0) - cross.T @ held
    known = information.diagonal() > SHOWN
    if not bool(known[0]):
        return None
    score = -scatter.gradient @ held
    score[real] += torch.einsum("npk,np->nk", columns, scatter.weighted[real])
    by_one = by_aircraft(score, likelihood.compared.airframe)
    count = likelihood.compared.y[real].isfinite().sum(0).clamp(min=1)
    means = columns[:, :, 0].sum(0).abs() / count / unit
    kept = information[known][:, known]
    kept = kept + torch.diag(1e-9 * kept.diagonal())
    variance = (by_one.T @ by_one)[known][:, known]
    return LocalPower(kept, variance, float(means.max()), _least(likelihood, name, start, at))


def _with_size(start: Tensor, at: int, size: float) -> Tensor:
    theta = start.clone()
    theta[at] = size
    return theta


def _least(likelihood: EffectsLikelihood, name: str, start: Tensor, at: int) -> float:
    """The smallest size at which the effect says itself that it can be what it is; zero where any size can."""
    effect, state = likelihood.catalogue[name], likelihood.compared.state
    low, high = 0.0, effect.parameters[at].high
    for _ in range(HALVINGS):
        middle = (low + high) / 2
        able = effect.plausible(state, _with_size(start, at, middle))
        low, high = (low, middle) if able else (middle, high)
    return high


def _columns(likelihood: EffectsLikelihood, name: str, start: Tensor, at: int) -> Tensor:
    """Sensitivities (r, p, k) of real flights, the secant of the size first; of a window the size alone."""
    parts = [_secant(likelihood, name, start, at)[:, :, None]]
    if likelihood.windowed(name) is None:
        others = [i for i in range(len(start)) if i != at]
        small = _with_size(start, at, likelihood.catalogue[name].parameters[at].scale)
        parts.append(likelihood.real_jacobian(name, small)[:, :, others])
    seen = likelihood.compared.y[likelihood.real].isfinite()
    return torch.where(seen[:, :, None], torch.cat(parts, 2), 0.0)


def _secant(likelihood: EffectsLikelihood, name: str, start: Tensor, at: int) -> Tensor:
    """What one unit of the size shifts (r, p)."""
    scale = likelihood.catalogue[name].parameters[at].scale
    small = _with_size(start, at, scale)
    return (likelihood.real_shift(name, small) - likelihood.real_shift(name, start)) / scale


def _without_effect(likelihood: EffectsLikelihood, name: str, share: float | None) -> Tensor:
    """Parameters with the size at zero; a window is in the middle of the grid, half as high as it may be."""
    start, effect = likelihood.start_of(name).clone(), likelihood.windowed(name)
    start[0] = 0.0
    of_flights = _share_parameter(likelihood, name)
    if of_flights is not None and share is not None:
        start[of_flights] = share
    if effect is None:
        return start
    low, high = effect.range_fl(likelihood.compared.state)
    half = max(effect.longest_fl(likelihood.compared.state) / 2, effect.narrowest_fl) / 2
    return effect.at_window(start, 0.0, (low + high) / 2 - half, (low + high) / 2 + half)


def _size_of(likelihood: EffectsLikelihood, name: str, start: Tensor) -> int:
    """The first parameter by which alone the effect can be what it is and shows in what is compared; else the first."""
    effect, seen = likelihood.catalogue[name], likelihood.compared.y[likelihood.real].isfinite()
    for at, parameter in enumerate(effect.parameters):
        able = effect.plausible(likelihood.compared.state, _with_size(start, at, parameter.high / 2))
        if able and bool((_secant(likelihood, name, start, at)[seen] != 0).any()):
            return at
    return 0


def _share_of(likelihood: EffectsLikelihood, name: str, fit: Fit | None) -> float | None:
    """Share of the flights that have an effect which takes some of them: as estimated, or a typical one."""
    at = _share_parameter(likelihood, name)
    if at is None:
        return None
    return float(fit.theta[name][at]) if fit is not None and name in fit.theta else TYPICAL_SHARE


def _share_parameter(likelihood: EffectsLikelihood, name: str) -> int | None:
    """Which parameter, beside the size, says how many flights have the effect."""
    parameters = likelihood.catalogue[name].parameters
    return next((i for i, p in enumerate(parameters) if p.from_heterogeneity and p.shown_as == "flights"), None)


def _smallest(power: LocalPower, rule: Rule, most: float, seed: int) -> float | None:
    """The size at which the share of cases is reached, by halving an interval; None where the largest has less."""
    direction = torch.zeros(len(power.information), dtype=torch.float64)
    direction[0] = 1.0
    low, high = 0.0, most
    if power.named(high * direction, rule, seed) < NAMED_IN:
        return None
    for _ in range(HALVINGS):
        middle = (low + high) / 2
        low, high = (low, middle) if power.named(middle * direction, rule, seed) >= NAMED_IN else (middle, high)
    return high


def _shows(likelihood: EffectsLikelihood, name: str, theta: Tensor) -> LargestDifference:
    """The entry whose mean an effect moves most."""
    compared = likelihood.compared
    mean = likelihood.real_shift(name, theta).mean(0)
    standing = mean.abs() / compared.negligible()
    most = int(standing.argmax())
    low, high = compared.level_range(compared.entries[most])
    return LargestDifference(compared.entries[most].quantity, low, high, float(mean[most]), float(standing[most]))
