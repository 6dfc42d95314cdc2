"""Heterogeneity between flights: which of them an effect takes, and how widely its size spreads between them."""

from collections.abc import Mapping

import torch
from torch import Tensor

from descentflow.diagnosis.inference.likelihood import EffectsLikelihood, Fit

MIN_VARIANCE_SHARE = 0.25
"""Share of the variance claimed that must show: a mean fixes the share of the flights only roughly."""
KURTOSIS = 5.0
"""A variance of n flights is known to about the root of so much over n."""


def with_heterogeneity(likelihood: EffectsLikelihood, theta: Mapping[str, Tensor]) -> dict[str, Tensor] | None:
    """Parameters with those set that say how flights differ; None where no effect has any.

    Example:
        >>> from descentflow.diagnosis.inference.example_sides import example_likelihood
        >>> from descentflow.effects import EFFECTS
        >>> likelihood = example_likelihood(EFFECTS["temperature"], [10.0])
        >>> with_heterogeneity(likelihood, {"temperature": torch.tensor([10.0]).double()}) is None  # alike for all
        True
    """
    catalogue = likelihood.catalogue
    having = [n for n in theta if any(p.from_heterogeneity and not p.is_spread for p in catalogue[n].parameters)]
    # A law says how flights differ already.
    having = [n for n in having if not likelihood.has_law(n, theta[n])]
    at = likelihood.compared.columns("rate")
    if not having or not len(at):
        return None
    found = dict(theta)
    bands = [likelihood.compared.entries[i].band for i in at.tolist()]
    state = likelihood.compared.state.rows(torch.nonzero(likelihood.real)[:, 0])
    for name in having:
        rest = {n: t for n, t in theta.items() if n != name}
        left = likelihood.compared.y[:, at] - likelihood.shift(rest)[:, at]
        normal = (
            left[~likelihood.real].nanmean(0).nan_to_num(0.0)
            if likelihood.has_reference
            else torch.zeros(len(at)).double()
        )
        excess = torch.full_like(state.cas_mps, torch.nan)
        excess[:, bands] = left[likelihood.real] - normal
        found[name] = likelihood.catalogue[name].learn_heterogeneity(state, theta[name], excess)
    return found


def heterogeneous_shifts(likelihood: EffectsLikelihood, fit: Fit) -> tuple[dict[str, Tensor], dict[str, float]]:
    """Shift (n, p) with each flight's own share of an effect, and how widely the shares spread, by effect.

    A flight's share is what it shows of the effect's own shape, drawn towards one by as much as shares differ no
    more between real flights than such shapes differ between the simulator's anyway.

    Example:
        >>> from descentflow.diagnosis.inference.search import fit_effects
        >>> from descentflow.diagnosis.inference.example_sides import example_likelihood
        >>> from descentflow.effects import EFFECTS
        >>> likelihood = example_likelihood(EFFECTS["temperature"], [10.0])
        >>> shifts, spreads = heterogeneous_shifts(likelihood, fit_effects(likelihood, ["temperature"]))
        >>> shifts["temperature"].shape, sorted(spreads)
        (torch.Size([160, 33]), ['temperature'])
    """
    spreads: dict[str, float] = {}
    shifts: dict[str, Tensor] = {}
    for name in fit.theta:
        if name in fit.per_flight:
            own_share = fit.per_flight[name].share[likelihood.real]
            shifts[name] = fit.per_flight[name].shift
            spreads[name] = float(own_share.std() / own_share.mean().clamp(min=1e-9))
            continue
        own, share, size = _shares(likelihood, fit, name)
        spread = _excess_variance(share[likelihood.real], share[~likelihood.real])
        spreads[name] = spread**0.5
        # Where shares do not spread every flight has the mean effect.
        held = spread * size / (1 + spread * size) * (share - 1) + 1
        shifts[name] = torch.where(likelihood.real[:, None], own * held[:, None], 0.0)
    return shifts, spreads


def together(shifts: Mapping[str, Tensor], likelihood: EffectsLikelihood) -> Tensor:
    """The sum (n, p) of the shifts of effects; zero where there is none.

    Example:
        >>> from descentflow.diagnosis.inference.example_sides import example_likelihood
        >>> float(together({}, example_likelihood()).abs().max())
        0.0
    """
    total = torch.zeros_like(likelihood.y)
    for shift in shifts.values():
        total = total + shift
    return total


def spreads_as_claimed(likelihood: EffectsLikelihood, fit: Fit, name: str) -> bool:
    """Whether shares of an effect differ between flights as one that takes some flights and leaves the others says.

    Of what takes the share s whole, shares are 1/s or zero: their variance is (1 - s)/s more than without it. A cause
    that takes all flights alike may imitate the mean of such an effect, and not that.

    Example:
        >>> from descentflow.diagnosis.inference.search import fit_effects
        >>> from descentflow.diagnosis.inference.example_sides import example_likelihood
        >>> from descentflow.effects import EFFECTS
        >>> likelihood = example_likelihood(EFFECTS["temperature"], [10.0])
        >>> spreads_as_claimed(likelihood, fit_effects(likelihood, ["temperature"]), "temperature")
        True
    """
    share, _ = likelihood.catalogue[name].mixture(fit.theta[name])
    if share >= 1.0 or not likelihood.has_reference or name in fit.per_flight:
        return True
    shown = _shares(likelihood, fit, name)[1]
    real, normal = shown[likelihood.real], shown[~likelihood.real]
    usual = float(normal.var())
    error = usual * (KURTOSIS / len(real) + KURTOSIS / len(normal)) ** 0.5
    excess = float(real.var()) - usual
    return bool(excess + 2 * error >= MIN_VARIANCE_SHARE * (1 - share) / share)


def _shares(likelihood: EffectsLikelihood, fit: Fit, name: str) -> tuple[Tensor, Tensor, Tensor]:
    """Shift (n, p) of one of the effects, what each flight shows of its shape (n,) with mean one, and how surely."""
    seen = likelihood.compared.y.isfinite()
    normal = torch.zeros(likelihood.y.shape[1], dtype=likelihood.y.dtype)
    if likelihood.has_reference:
        normal = likelihood.compared.y[~likelihood.real].nanmean(0).nan_to_num(0.0) * likelihood.compared.free
    own = torch.where(seen, likelihood.all_shift(name, fit.theta[name]), 0.0)
    others = likelihood.shift({n: t for n, t in fit.theta.items() if n != name})
    rest = torch.where(seen, likelihood.y - others - normal, 0.0)
    weighted = likelihood.whitening.apply(own)
    size = (own * weighted).sum(1).clamp(min=1e-9)
    return own, (weighted * rest).sum(1) / size, size


def _excess_variance(real: Tensor, normal: Tensor) -> float:
    """Robust variance of the real shares beyond that of the simulator's; zero unless it stands out."""

    def variance(values: Tensor) -> float:
        if len(values) < 2:
            return 0.0
        # Half the middle 80 %: for a normal distribution 1.28 standard deviations; two groups keep their distance.
        low, high = (float(values.quantile(q)) for q in (0.1, 0.9))
        return ((high - low) / 2.563) ** 2

    found, usual = variance(real), variance(normal)
    return found - usual if usual > 0 and found > 1.5 * usual else 0.0
