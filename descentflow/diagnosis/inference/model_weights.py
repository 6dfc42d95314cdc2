r"""Weights of models by how well they foretell what they were not fitted to, and how sure that is.

Pseudo-BMA+ (Yao, Vehtari, Simpson and Gelman 2018, Bayesian Analysis 13, section 3.4): with :math:`l_{ak}` the held-out
log score of model k on aircraft a and weights :math:`\alpha \sim \mathrm{Dirichlet}(1, \ldots, 1)` over the n aircraft,

.. math:: w_k = E_\alpha\left[\frac{\exp(z_k)}{\sum_j \exp(z_j)}\right], \qquad
          z_k = n \sum_a \alpha_a l'_{ak} + \ln \pi_k.

Models that differ by less than the scatter between aircraft share the weight. Any aircraft may be an odd one, of which
no model knows anything, with a small probability :math:`\epsilon`; what is odd is as likely under each as under the
best,

.. math:: \exp(l'_{ak}) = (1 - \epsilon) \exp(l_{ak}) + \epsilon \max_j \exp(l_{aj}),

so one aircraft decides for at most :math:`-\ln \epsilon` nats, and a lead of many that a few make is no lead.
"""

import math

import torch
from torch import Tensor

ODD = 0.01
"""Share of the aircraft that may be odd."""
DRAWS = 2000
"""Of the Bayesian bootstrap: the standard error of a weight is at most 1.1 %."""


def weights_of(log_scores: Tensor, log_prior: Tensor, seed: int = 0) -> Tensor:
    """Weights (k,) of models that add up to one.

    Args:
        log_scores: (k, a) held-out log score of each aircraft.
        log_prior: (k,) logarithm of the prior weight, up to a constant.
        seed: Of the bootstrap.

    Example:
        >>> same = torch.tensor([[-1.0, -2.0, -3.0], [-1.0, -2.0, -3.0]]).double()
        >>> weights_of(same, torch.tensor([0.0, -2.0]).double()).round(decimals=2)
        tensor([0.8800, 0.1200], dtype=torch.float64)
    """
    n = log_scores.shape[1]
    log_scores = _bounded(log_scores)
    generator = torch.Generator().manual_seed(seed)
    gaps = -torch.rand(n, DRAWS, generator=generator, dtype=torch.float64).clamp(min=1e-12).log()
    drawn = n * (log_scores - log_scores.mean(0)) @ (gaps / gaps.sum(0))
    return (drawn + log_prior[:, None]).softmax(0).mean(1)


def _bounded(log_scores: Tensor) -> Tensor:
    """Log scores (k, a) of models by which an aircraft may be odd."""
    best = log_scores.max(0).values
    odd = torch.full_like(log_scores, math.log(ODD))
    return torch.logaddexp(math.log1p(-ODD) + log_scores - best, odd) + best
