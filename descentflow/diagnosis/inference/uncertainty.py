"""How well parameters are known: by the scatter of whole aircraft, and by how their signatures may be off."""

import torch
from torch import Tensor

from descentflow.diagnosis.inference.aircraft_groups import FOLDS, by_aircraft
from descentflow.diagnosis.inference.fold_sums import solved
from descentflow.diagnosis.inference.likelihood import EffectsLikelihood, Fit
from descentflow.diagnosis.inference.linear_algebra import Design


def covariance(likelihood: EffectsLikelihood, fit: Fit) -> Tensor:
    """Covariance (k, k) of the parameters.

    Robust to what flights of one aircraft have in common; with how signatures may be off, as their prior says; and
    with what a model that is off by negligible shifts, half of them alike in all bands of a quantity, would add: more
    flights do not make equations more exact.

    Example:
        >>> from descentflow.diagnosis.inference.search import fit_effects
        >>> from descentflow.diagnosis.inference.example_sides import example_likelihood
        >>> from descentflow.effects import EFFECTS
        >>> likelihood = example_likelihood(EFFECTS["temperature"], [10.0])
        >>> covariance(likelihood, fit_effects(likelihood, ["temperature"])).sqrt() < 1.0  # K
        tensor([[True]])
    """
    design, sums = fit.design, likelihood.sums
    profiled = sums.profiled(sums.rest(fit.shift, design, sums.of_columns(design)), everyone=True)
    step = solved(profiled, design.own_ridge)
    common = profiled.common[0, :, -1] - profiled.common[0, :, :-1] @ step[0]
    error = sums.errors(fit.shift, design, step.expand(FOLDS, -1), common.expand(FOLDS, -1))
    q = likelihood.whitening.apply(error)
    of_real = q[likelihood.real]
    gradient = torch.zeros(len(q), design.count - design.n_common, dtype=q.dtype)
    gradient[likelihood.real] = torch.cat([torch.einsum("npk,np->nk", design.own, of_real), of_real @ design.alike], 1)
    of_common = torch.cat([q[:, likelihood.compared.free], torch.einsum("npq,np->nq", sums.common, q)], 1)
    gradient = gradient - of_common @ profiled.common[0, :, :-1]
    total = by_aircraft(gradient * likelihood.whitening.optimism[:, None], likelihood.compared.airframe)
    prior, information = torch.diag(design.own_ridge), profiled.inner[0, :-1, :-1]
    scatter = total.T @ total + _by_negligible(likelihood, design, profiled.common[0, :, :-1]) + prior
    known = information.diagonal() + design.own_ridge > 1e-9
    inverse = torch.zeros_like(information)
    inverse[known.nonzero(), known.nonzero()[:, 0]] = torch.linalg.pinv((information + prior)[known][:, known])
    n, k = len(total), design.n_parameters
    return (n / max(n - 1, 1) * inverse @ scatter @ inverse)[:k, :k]


def _by_negligible(likelihood: EffectsLikelihood, design: Design, common: Tensor) -> Tensor:
    """Covariance of the gradients if shifts were off by what is negligible; ``common`` (b, k + c) follows."""
    precision, free = likelihood.sums.precision.sum(0), likelihood.compared.free
    f = int(free.sum())
    answer = torch.cat([*(block.products.sum(0) for block in design.blocks), precision @ design.alike], 1)
    answer = answer - precision[:, free] @ common[:f] - likelihood.sums.common_precision.sum(0).T @ common[f:]
    answer = answer * likelihood.compared.negligible()[:, None]
    scatter = 0.5 * answer.T @ answer
    for quantity in likelihood.compared.quantities():
        alike = answer[likelihood.compared.columns(quantity)].sum(0)
        scatter = scatter + 0.5 * torch.outer(alike, alike)
    return scatter
