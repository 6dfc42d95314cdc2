"""Covariances of mixture components, shrunk towards the one that they share: few flights know little of their own."""

from torch import Tensor


def shrunk(covariances: Tensor, counts: Tensor, prior_flights: float) -> Tensor:
    r"""Covariances (k, d, d) to which so many flights of the covariance within all components were added.

    The mean over the flights, :math:`S = \sum_k n_k S_k / n`, is what a mixture with one covariance for all components
    would have (``tied`` in scikit-learn); each becomes :math:`(n_k S_k + \nu S) / (n_k + \nu)`, as with an
    inverse-Wishart prior about it (Fraley and Raftery 2007, doi:10.1007/s00357-007-0004-5). Without, a component of a
    dozen flights has some directions in which it hardly varies.

    Args:
        covariances: (k, d, d) of the flights of each component.
        counts: (k,) flights of each.
        prior_flights: The number added; zero for none.

    Example:
        >>> wide, narrow = 4.0 * torch.eye(2), torch.zeros(2, 2)
        >>> shrunk(torch.stack([wide, narrow]), torch.tensor([15.0, 5.0]), 5.0)[1]  # half of the mean, 3
        tensor([[1.5000, 0.0000],
                [0.0000, 1.5000]])
    """
    if prior_flights == 0 or len(covariances) == 1:
        return covariances
    own = counts[:, None, None]
    shared = (own * covariances).sum(0) / counts.sum()
    return (own * covariances + prior_flights * shared) / (own + prior_flights)
