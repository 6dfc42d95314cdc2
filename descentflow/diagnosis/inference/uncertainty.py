"""How well parameters are known: by the scatter of whole aircraft, and by what equations leave out."""

import torch
from torch import Tensor

from descentflow.diagnosis.inference.aircraft_groups import by_aircraft
from descentflow.diagnosis.inference.likelihood import EffectsLikelihood, Fit
from descentflow.diagnosis.inference.linear_algebra import Moments

MISFIT = 0.03
"""Share of a shift by which the equations of its effect may be off. Set by hand on simulated flights."""


def covariance(likelihood: EffectsLikelihood, fit: Fit) -> Tensor:
    """Covariance (k, k) of the parameters.

    Robust to what flights of one aircraft have in common, and with what a model that is off by negligible shifts,
    half of them alike in all bands of a quantity, would add: more flights do not make equations more exact.

    Example:
        >>> from descentflow.diagnosis.inference.search import fit_effects
        >>> from descentflow.diagnosis.inference.example_sides import example_likelihood
        >>> from descentflow.effects import EFFECTS
        >>> likelihood = example_likelihood(EFFECTS["temperature"], [10.0])
        >>> covariance(likelihood, fit_effects(likelihood, ["temperature"])).sqrt() < 1.0  # K
        tensor([[True]])
    """
    design = fit.design
    moments = likelihood.moments(likelihood.weighted_rest(fit.shift), design)
    mean, step = moments.solved()
    free = likelihood.compared.free
    error = likelihood.y - fit.shift - design.columns @ step
    error[:, free] -= mean
    q = likelihood.whitening.apply(error)
    gradient = torch.einsum("npk,np->nk", design.columns, q)
    if len(mean):
        gradient -= q[:, free] @ torch.linalg.solve(moments.mean, moments.cross)
    total = by_aircraft(gradient * likelihood.whitening.optimism[:, None], likelihood.compared.airframe)
    scatter = total.T @ total + _by_misfit(likelihood, fit, moments)
    information, _ = moments.profiled()
    known = information.diagonal() > 1e-9 + 1e-7 * moments.curvature.diagonal()
    inverse = torch.zeros_like(information)
    inverse[known.nonzero(), known.nonzero()[:, 0]] = torch.linalg.pinv(information[known][:, known])
    n = len(total)
    return (n / max(n - 1, 1) * inverse @ scatter @ inverse)[design.n_common :, design.n_common :]


def _by_misfit(likelihood: EffectsLikelihood, fit: Fit, moments: Moments) -> Tensor:
    """Covariance of the gradients if shifts were off by what is negligible, and by a small share of themselves."""
    design = fit.design
    answer = design.products[likelihood.real].sum(0)
    if len(moments.mean):
        weight = likelihood.whitening.total(likelihood.real)[:, likelihood.compared.free]
        answer = answer - weight @ torch.linalg.solve(moments.mean, moments.cross)
    size = fit.shift[likelihood.real].mean(0).abs()
    answer = answer * (likelihood.compared.negligible() + MISFIT * size)[:, None]
    scatter = 0.5 * answer.T @ answer
    for quantity in likelihood.compared.quantities():
        alike = answer[likelihood.compared.columns(quantity)].sum(0)
        scatter = scatter + 0.5 * torch.outer(alike, alike)
    return scatter
