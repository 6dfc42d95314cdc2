r"""Mixture components that are pairs: a cluster of speeds, and a cluster of drags given the speed.

Who flies chooses the speed, and what happens on the way (a rate held, brakes, thrust) shows in the drag. With as many
free components, each pair of an operator and a way to descend has its own few flights to learn from. Here the speed
weights c of component (i, j) are $N(\mu_i, \Sigma_i)$, and its drag weights $N(a_j + B_j c, S_j)$: all flights of an
operator say how fast it flies, all that hold a rate how they do it, and only the proportions of pairs are free. That is
a mixture of more than one cluster structure (Galimberti and Soffritti 2007, doi:10.1016/j.csda.2007.02.019) in which
one block of weights follows the other by regression.
"""

from dataclasses import dataclass

import torch
from torch import Tensor

from descentflow.densities.shrunk_covariances import shrunk

SMALL = 1e-9
"""Added to variances of standardised speed weights, so that drag can follow them where all are alike."""


@dataclass(frozen=True)
class CrossedClusters:
    """Numbers of clusters of either kind; the component of speed i and drag j is number ``i * n_drag + j``.

    Attributes:
        n_speed: Clusters of the speed weights.
        n_drag: Clusters of the drag weights given the speed weights.
        n_drag_weights: So many of the weights are of drag: the first.

    Example:
        >>> CrossedClusters(3, 2, n_drag_weights=4).n_components
        6
    """

    n_speed: int
    n_drag: int
    n_drag_weights: int

    @property
    def n_components(self) -> int:
        """Number of mixture components: of pairs."""
        return self.n_speed * self.n_drag

    def n_parameters(self, dimension: int) -> int:
        """Free parameters of a mixture of d weights.

        Example:
            >>> from descentflow.densities.mixture_parameters import n_parameters
            >>> CrossedClusters(1, 1, 2).n_parameters(3) == n_parameters(1, 3)
            True
        """
        drag, speed = self.n_drag_weights, dimension - self.n_drag_weights
        of_speed = speed * (speed + 3) // 2
        of_drag = drag * (drag + 3) // 2 + drag * speed
        return self.n_speed * of_speed + self.n_drag * of_drag + self.n_components - 1

    def check(self, n_components: int, dimension: int) -> None:
        """See that clusters that were read are of so many components and weights.

        Raises:
            ValueError: If they are not.
        """
        if min(self.n_speed, self.n_drag) < 1 or self.n_components != n_components:
            raise ValueError(f"{self.n_speed} x {self.n_drag} clusters of {n_components} mixture components")
        if not 0 < self.n_drag_weights < dimension:
            raise ValueError(f"{self.n_drag_weights} weights of drag among {dimension}")

    def tied(
        self, counts: Tensor, means: Tensor, covariances: Tensor, prior_flights: float = 0.0
    ) -> tuple[Tensor, Tensor]:
        """Means (k, d) and covariances (k, d, d) of greatest likelihood, given what each component's flights are like.

        Args:
            counts: (k,) flights of each component, of their responsibilities.
            means: (k, d) of their weights.
            covariances: (k, d, d) of their weights.
            prior_flights: Flights of the covariance that clusters share, added to each one's own.

        Example:
            >>> counts = torch.tensor([1.0, 3.0]).double()  # flights of two speeds that descend in one way
            >>> means, own = torch.tensor([[0.0, 10.0], [1.0, 20.0]]).double(), torch.eye(2).repeat(2, 1, 1).double()
            >>> CrossedClusters(2, 1, n_drag_weights=1).tied(counts, means, own)[0]
            tensor([[ 0.0380, 10.0000],
                    [ 0.9873, 20.0000]], dtype=torch.float64)
        """
        drag = self.n_drag_weights
        n, mean, covariance = self._pooled(counts, means, covariances, 1)
        locs, spreads = mean[:, drag:], shrunk(covariance[:, drag:, drag:], n, prior_flights)
        n, mean, covariance = self._pooled(counts, means, covariances, 0)
        covariance = shrunk(covariance, n, prior_flights)
        of_speed = covariance[:, drag:, drag:]
        small = SMALL * torch.eye(of_speed.shape[1]).to(of_speed)
        slopes = torch.linalg.solve(of_speed + small, covariance[:, drag:, :drag]).mT  # (j, drag, speed)
        rest = covariance[:, :drag, :drag] - slopes @ covariance[:, drag:, :drag]
        of_drag = mean[:, :drag] + (slopes @ (locs[:, None] - mean[:, drag:])[..., None])[..., 0]
        both = torch.cat([of_drag, locs[:, None].expand(-1, self.n_drag, -1)], 2)
        across = slopes @ spreads[:, None]  # (i, j, drag, speed)
        upper = torch.cat([rest + across @ slopes.mT, across], 3)
        lower = torch.cat([across.mT, spreads[:, None].expand(-1, self.n_drag, -1, -1)], 3)
        return both.flatten(0, 1), torch.cat([upper, lower], 2).flatten(0, 1)

    def _pooled(self, counts: Tensor, means: Tensor, covariances: Tensor, over: int) -> tuple[Tensor, Tensor, Tensor]:
        """Flights, means and covariances with the clusters of one kind (0: speed, 1: drag) taken together."""
        shape = (self.n_speed, self.n_drag)
        flights, mean = counts.reshape(shape), means.reshape(*shape, -1)
        n = flights.sum(over)
        share = (flights / n.unsqueeze(over))[..., None]
        centre = (share * mean).sum(over)
        off = mean - centre.unsqueeze(over)
        spread = covariances.reshape(*shape, *covariances.shape[1:]) + off[..., None] * off[..., None, :]
        return n, centre, (share[..., None] * spread).sum(over)
