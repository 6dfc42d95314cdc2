"""Flights that the spread between flights is learnt from."""

from torch import Tensor

from descentflow.diagnosis.inference.two_sides import Compared

MIN_NORMAL_FLIGHTS = 100
"""Flights of a simulator from which the spread between flights is learnt without the real ones."""


def normal_flights(compared: Compared) -> Tensor | None:
    """Flights that the spread is learnt from: the simulator's where they are enough, else all.

    An effect that takes some flights and leaves others would widen the spread in its own direction, and so hide itself.

    Example:
        >>> from descentflow.diagnosis.inference.example_sides import example_sides
        >>> int(normal_flights(example_sides(n=120)).sum()), normal_flights(example_sides(n=50)) is None
        (120, True)
    """
    known = ~compared.real
    enough = int(known.sum()) >= max(MIN_NORMAL_FLIGHTS, compared.y.shape[1])
    return known if enough and bool(compared.free.all()) else None
