"""How well parameters are known: by the scatter of whole aircraft, and by what equations leave out."""

import torch
from torch import Tensor

from descentflow.diagnosis.inference.aircraft_groups import by_cluster
from descentflow.diagnosis.inference.likelihood import Contest, Fit
from descentflow.diagnosis.inference.linear_algebra import Moments

MISFIT = 0.03
"""Share of a shift by which the equations of its effect may be off."""


def covariance(contest: Contest, fit: Fit) -> Tensor:
    """Covariance (k, k) of the parameters.

    Robust to what flights of one aircraft have in common, and with what a model that is off by negligible shifts,
    half of them alike in all bands of a quantity, would add: more flights do not make equations more exact.
    """
    design = fit.design
    moments = contest.moments(fit.shift, design)
    mean, step = moments.solved()
    free = contest.compared.free
    error = contest.y - fit.shift - design.columns @ step
    error[:, free] -= mean
    q = contest.whitening.apply(error)
    score = torch.einsum("npk,np->nk", design.columns, q)
    if len(mean):
        score -= q[:, free] @ torch.linalg.solve(moments.mean, moments.cross)
    total = by_cluster(score * contest.whitening.optimism[:, None], contest.compared.cluster)
    scatter = total.T @ total + _by_misfit(contest, fit, moments)
    information, _ = moments.profiled()
    known = information.diagonal() > 1e-9 + 1e-7 * moments.curvature.diagonal()
    inverse = torch.zeros_like(information)
    inverse[known.nonzero(), known.nonzero()[:, 0]] = torch.linalg.pinv(information[known][:, known])
    n = len(total)
    return (n / max(n - 1, 1) * inverse @ scatter @ inverse)[design.n_common :, design.n_common :]


def _by_misfit(contest: Contest, fit: Fit, moments: Moments) -> Tensor:
    """Covariance of the scores if shifts were off by what is negligible, and by a small share of themselves."""
    design = fit.design
    answer = design.products[contest.real].sum(0)
    if len(moments.mean):
        weight = contest.whitening.total(contest.real)[:, contest.compared.free]
        answer = answer - weight @ torch.linalg.solve(moments.mean, moments.cross)
    size = fit.shift[contest.real].mean(0).abs()
    answer = answer * (contest.compared.negligible() + MISFIT * size)[:, None]
    scatter = 0.5 * answer.T @ answer
    for quantity in contest.compared.quantities():
        alike = answer[contest.compared.columns(quantity)].sum(0)
        scatter = scatter + 0.5 * torch.outer(alike, alike)
    return scatter
