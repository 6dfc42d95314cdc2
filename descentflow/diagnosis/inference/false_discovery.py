"""Which of many tests stand out: false-discovery rates."""


def benjamini_hochberg(p_values: list[float]) -> list[float]:
    """Smallest false-discovery rate at which each would be called (Benjamini and Hochberg 1995).

    Example:
        >>> benjamini_hochberg([0.01, 0.5, 0.02])
        [0.03, 0.5, 0.03]
    """
    order = sorted(range(len(p_values)), key=lambda i: p_values[i])
    found, smallest = [1.0] * len(p_values), 1.0
    for rank, i in reversed(list(enumerate(order, start=1))):
        smallest = min(smallest, p_values[i] * len(p_values) / rank)
        found[i] = smallest
    return found
