"""Number of principal components: as few as explain the share of the variance that is asked for."""

from torch import Tensor

ROUNDING = 1e-12
"""A share that misses the one asked for by rounding alone explains it."""


def explained_share(eigenvalues: Tensor) -> Tensor:
    """Share of the variance that the first k components explain together, for each k.

    Args:
        eigenvalues: (L,) in descending order; negative ones (of a covariance estimated pairwise) count as 0.

    Returns:
        (L,) ascending to one.

    Example:
        >>> explained_share(torch.tensor([6.0, 3.0, 1.0]))
        tensor([0.6000, 0.9000, 1.0000])
    """
    positive = eigenvalues.clamp(min=0)
    return positive.cumsum(0) / positive.sum()


def number_of_components(share: Tensor, explained_variance: float) -> int:
    """The fewest components that explain a share of the variance (paper, section 2.2: 80 %).

    Args:
        share: (L,) of :func:`explained_share`.
        explained_variance: Share asked for, between 0 and 1: the option ``data.explained_variance``.

    Example:
        >>> number_of_components(explained_share(torch.tensor([6.0, 3.0, 1.0])), 0.8)
        2
    """
    return int((share < explained_variance - ROUNDING).sum()) + 1
