"""The law of a density's normals by bins of the entry level, learnt from training flights with the density held.

EM: weights drawn of each flight given what it shows, as flows are trained, become normals; each bin's mean and
covariance are those of its flights' normals, weighted by how probable the draws are in that bin. A bin's mean begins
with zero, and its covariance with what all bins share, as some flights more; how many, halves of the flights decide,
each judging what the other taught: of some thousand flights means are worth learning, covariances seldom, for a few
flights stray far. Where nothing gains on the other half, there is no law.
"""

from dataclasses import dataclass
from math import inf

import torch
from torch import Tensor

from descentflow.densities.entry_gate import bin_edges
from descentflow.densities.entry_law import EntryLaw
from descentflow.densities.importance import propose
from descentflow.densities.transformed import TransformedDensity, standard_normal
from descentflow.representation.evidence import Evidence

DRAWS = 16
"""Of each flight's weights: the mean of a bin of a hundred flights is then known as well as from the flights alone."""
MOST_FLIGHTS = 4_000
"""Flights that teach the law at most, evenly chosen: a thousand a bin."""
STEPS, TOLERANCE = 8, 1e-4
"""EM steps at most, and the gain (nats per flight) at which they end."""
OF_MEANS = (4.0, 16.0, 64.0, 256.0)
"""Flights that zero counts as in a bin's mean: one over the variance of the bins' means, which are tenths."""
OF_COVARIANCES = (inf, 256.0, 64.0, 16.0, 4.0)
"""Flights that the shared covariance counts as in a bin's own, in multiples of d + 2: with one, an inverse Wishart
prior just has a mean. Infinitely many: bins differ by their means alone."""


@dataclass(frozen=True)
class _Prior:
    """Prior of the bins, as flights."""

    of_mean: float
    of_covariance: float


@dataclass(frozen=True)
class _Drawn:
    """Normals (n, S, d) of n flights, and the draws' log weights (n, S); both in bins (n,)."""

    normals: Tensor
    log_weight: Tensor
    bins: Tensor

    def rows(self, index: Tensor) -> "_Drawn":
        return _Drawn(self.normals[index], self.log_weight[index], self.bins[index])


@torch.no_grad()
def learn_entry_law(density: TransformedDensity, evidence: Evidence, entry: Tensor) -> EntryLaw | None:
    """The law by which training flights are most probable, or None where flights do not differ by their entry.

    Args:
        density: Without a context and without a law.
        evidence: Of n training flights.
        entry: (n,) their entry levels, as indices of the grid.

    Example:
        >>> from descentflow.densities.gaussian import GaussianDensity
        >>> entry, generator = torch.arange(400), torch.Generator().manual_seed(0)
        >>> weights = torch.randn(400, 1, generator=generator).double() + torch.where(entry < 200, -1.0, 1.0)[:, None]
        >>> law = learn_entry_law(GaussianDensity(1), Evidence.of_weights(weights), entry)
        >>> (law.shift[:, 0] > 0).tolist()
        [False, False, True, True]
        >>> learn_entry_law(GaussianDensity(1), Evidence.of_weights(weights), torch.full((400,), 150)) is None
        True
    """
    some = torch.arange(0, len(evidence), -(-len(evidence) // MOST_FLIGHTS))
    edges = bin_edges(entry)
    if not len(edges):
        return None
    drawn = _drawn(density, evidence.rows(some.to(evidence.group.device)), torch.bucketize(entry.cpu()[some], edges))
    d = density.dimension
    tried = {_Prior(n, inf): 0.0 for n in OF_MEANS}
    for prior in tried:
        tried[prior] = _held_out_gain(drawn, prior)
    means = max(tried, key=lambda prior: tried[prior]).of_mean
    for n in OF_COVARIANCES[1:]:
        prior = _Prior(means, n * (d + 2))
        tried[prior] = _held_out_gain(drawn, prior)
        if tried[prior] < max(tried.values()):
            break  # fewer flights of the prior lose more
    best = max(tried, key=lambda prior: tried[prior])
    if not tried[best] > 0:
        return None
    found = _fitted(drawn, best)
    if found is None:
        return None
    shift, root = found
    shares = torch.bincount(torch.bucketize(entry.cpu(), edges), minlength=len(shift)).double()
    return EntryLaw(edges, shares / shares.sum(), shift, root)


def _drawn(density: TransformedDensity, evidence: Evidence, bins: Tensor) -> _Drawn:
    """Normals of each flight given what it shows; of flights whose weights are known, those themselves."""
    if evidence.known:
        white = density.to_white(evidence.points)[0].double().cpu()[:, None]
        return _Drawn(white, white.new_zeros(white.shape[:2]), bins)
    proposing = density.wide_gaussian()
    normals = evidence.points.new_empty(len(evidence), DRAWS, density.dimension)
    log_weight = evidence.points.new_empty(len(evidence), DRAWS)
    for index, rows in evidence.chunks():
        proposals = propose(proposing, rows, DRAWS, seed=0)
        white, log_det = density.to_white(proposals.weights.flatten(0, 1))
        normals[index] = white.double().reshape(len(rows), DRAWS, -1)
        log_prob = (standard_normal(white) + log_det).double()
        log_weight[index] = log_prob.reshape(len(rows), DRAWS) + proposals.log_offset
    good = normals.isfinite().all(-1) & log_weight.isfinite()
    normals, log_weight = torch.where(good[..., None], normals, 0.0), torch.where(good, log_weight, -torch.inf)
    told = good.any(1)
    return _Drawn(normals[told].cpu(), log_weight[told].cpu(), bins[told.cpu()])


def _fitted(drawn: _Drawn, prior: _Prior) -> tuple[Tensor, Tensor] | None:
    """Means (b, d) and Cholesky factors (b, d, d) of greatest posterior probability; None as :func:`_maximised`."""
    n_bins, d = int(drawn.bins.max()) + 1, drawn.normals.shape[2]
    eye = torch.eye(d, dtype=torch.float64)
    shift, root, before = torch.zeros(n_bins, d).double(), eye.expand(n_bins, -1, -1), -torch.inf
    for _ in range(STEPS):
        terms = drawn.log_weight + _log_ratio(drawn, shift, root)
        reached = float(terms.logsumexp(1).mean())
        if reached - before < TOLERANCE:
            break
        before = reached
        found = _maximised(drawn, terms.softmax(1), prior)
        if found is None:
            return None
        shift, root = found
        if drawn.normals.shape[1] == 1:
            break  # what is known needs no second look
    return shift, root


def _maximised(drawn: _Drawn, share: Tensor, prior: _Prior) -> tuple[Tensor, Tensor] | None:
    """The M step, of each draw's share (n, S) of its flight.

    None where means of bins vary more than all flights do, as those of one or two flights each may.
    """
    counts, means, seconds = [], [], []
    for one in range(int(drawn.bins.max()) + 1):
        mine = drawn.bins == one
        weight, normals = share[mine].flatten()[:, None], drawn.normals[mine].flatten(0, 1)
        counts.append(mine.sum().double())
        means.append((weight * normals).sum(0))
        seconds.append((weight * normals).T @ normals)
    n, total, second = torch.stack(counts), torch.stack(means), torch.stack(seconds)
    shift = total / (n + prior.of_mean)[:, None]
    across = total[:, :, None] * shift[:, None]
    own = second - across - across.mT + n[:, None, None] * shift[:, :, None] * shift[:, None]
    # All flights keep unit variance: what lies between bins is taken from within.
    eye = torch.eye(total.shape[1], dtype=torch.float64)
    between = (n[:, None, None] * shift[:, :, None] * shift[:, None]).sum(0) / n.sum()
    shared, failed = torch.linalg.cholesky_ex(eye - between)
    if failed:
        return None
    if prior.of_covariance == inf:
        return shift, shared.expand(len(n), -1, -1)
    covariance = (own + prior.of_covariance * shared @ shared.T) / (n + prior.of_covariance)[:, None, None]
    return shift, torch.linalg.cholesky(covariance)


def _log_ratio(drawn: _Drawn, shift: Tensor, root: Tensor) -> Tensor:
    """Log of a bin's normal over the standard one (n, S), at each flight's own draws."""
    found = torch.empty_like(drawn.log_weight)
    for one in range(len(shift)):
        mine = drawn.bins == one
        normals = drawn.normals[mine]
        white = torch.linalg.solve_triangular(root[one], (normals - shift[one]).flatten(0, 1).T, upper=False).T
        log_det = root[one].diagonal().log().sum()
        found[mine] = 0.5 * (normals.square().sum(2) - white.square().sum(1).unflatten(0, (-1, normals.shape[1])))
        found[mine] -= log_det
    return found


def _held_out_gain(drawn: _Drawn, prior: _Prior) -> float:
    """Gain (nats per flight) over standard normals of each half of the flights by the other half's law."""
    half, n_bins, total = torch.arange(len(drawn.bins)) % 2, int(drawn.bins.max()) + 1, 0.0
    for one in (0, 1):
        teaches, judges = drawn.rows(half != one), drawn.rows(half == one)
        found = _fitted(teaches, prior)
        if found is None or len(found[0]) < n_bins:
            return -torch.inf  # a bin of which one half has no flight, or too few for such a prior
        shift, root = found
        told = (judges.log_weight + _log_ratio(judges, shift, root)).logsumexp(1) - judges.log_weight.logsumexp(1)
        total += float(told.sum())
    return total / len(drawn.bins)
