"""Base of the tables that have a row for each flight."""

from dataclasses import dataclass, fields
from typing import Self

from torch import Tensor


@dataclass(frozen=True)
class FlightRows:
    """Dataclass of tensors whose first dimension counts flights.

    Example:
        >>> from descentflow.simulation.injected import neutral
        >>> len(neutral(3).rows(torch.tensor([0, 2])).noise_factor)
        2
    """

    def rows(self, index: Tensor) -> Self:
        """Return the flights of an index tensor."""
        return type(self)(**{one.name: getattr(self, one.name)[index] for one in fields(self)})
