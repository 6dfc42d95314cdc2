r"""Law of an effect that flights have each to an own degree: window hypotheses of one shape, and their law.

A flight that has the effect in window w shows

.. math:: o_i + a_i\,(c_{u(w)} - c_{l(w)}) \circ s_i, \qquad a_i \sim N(\bar a, \sigma^2),

with its own shape :math:`s_i` (what a size of one shows in every band), an offset :math:`o_i`, and weights that are the
difference of two rows of one table :math:`c`: for a window the share of each band below either end.
"""

from abc import abstractmethod
from dataclasses import dataclass
from typing import ClassVar

import torch
from torch import Tensor

from descentflow.effects.effect import Effect, FlightChange, Parameter, ShownAs
from descentflow.effects.flight_state import FlightState


def spread_of(name: str, high: float, unit: str, scale: float, label: str, shown_as: ShownAs = "number") -> Parameter:
    """A spread between flights: zero where all that have the effect have it alike.

    Example:
        >>> spread_of("spread_extra", 2.0, "1", 0.1, "spread of the drag added").is_spread
        True
    """
    return Parameter(
        name, 0.0, high, unit, scale, from_heterogeneity=True, is_spread=True, label=label, shown_as=shown_as
    )


MOST_SPREAD = 0.5
"""Of sizes between flights, in their mean: all but one in forty of those that have an effect have it with its sign. A
law of a wider spread would be of flights that are unlike each other, and of no effect."""


def positive_size(uniform: Tensor, mean: Tensor, spread: Tensor) -> Tensor:
    """Sizes of a normal law cut off at zero, by the inverse of its distribution function.

    Example:
        >>> positive_size(torch.tensor([0.5]).double(), torch.tensor(0.4).double(), torch.tensor(0.1).double())
        tensor([0.4000], dtype=torch.float64)
    """
    if float(spread) == 0.0:
        return mean.expand_as(uniform)
    below = torch.special.ndtr(-mean / spread)
    size: Tensor = mean + spread * torch.special.ndtri((below + uniform * (1 - below)).clamp(max=1 - 1e-12))
    return size


@dataclass(frozen=True)
class Windows:
    """W windows in which n flights may have an effect, over S slots.

    Attributes:
        slots: Quantity and band of each slot; the band of a quantity of the whole flight is -1.
        shape: (n, S) what a size of one shows.
        offset: (n, S) what it shows besides that.
        table: (E, S) weights of the shape.
        lower: (W,) row that is taken off...
        upper: (W,) ...the row of each window.

    Example:
        >>> from descentflow.effects import EFFECTS
        >>> from descentflow.effects._example_flights import example_flights
        >>> brakes, state = EFFECTS["speed_brake"], example_flights()
        >>> theta = torch.tensor([0.3, 200.0, 240.0, 0.5, 0.0, 10.0, 5.0, 0.1]).double()
        >>> windows = brakes.windows(state, theta)
        >>> windows.slots[0], windows.shape.shape, len(windows.lower) == len(brakes.log_prior(state, theta))
        (('rate', 0), torch.Size([6, 12]), True)
    """

    slots: tuple[tuple[str, int], ...]
    shape: Tensor
    offset: Tensor
    table: Tensor
    lower: Tensor
    upper: Tensor

    @property
    def weights(self) -> Tensor:
        """Weights (W, S) of the shape in each window."""
        return self.table[self.upper] - self.table[self.lower]


@dataclass(frozen=True)
class Learnt:
    """Sums over flights for each hypothesis, of the share, size and squared size expected.

    Shapes (W,); ``flights`` is their number.

    Example:
        >>> Learnt(torch.ones(2), torch.ones(2), torch.ones(2), flights=8).share
        0.25
    """

    taken: Tensor
    size: Tensor
    squared: Tensor
    flights: int

    @property
    def share(self) -> float:
        """Share of the flights that have the effect in some window."""
        return float(self.taken.sum()) / self.flights

    def mean_and_spread(self) -> tuple[float, float]:
        """Mean and standard deviation of the sizes of those that have it."""
        total = float(self.taken.sum())
        mean = float(self.size.sum()) / max(total, 1e-9)
        return mean, max(float(self.squared.sum()) / max(total, 1e-9) - mean**2, 0.0) ** 0.5


class DiffersByFlight(Effect):
    """An effect that some flights have, each in its own window and size, and others have not.

    Its parameters say the law: the share of the flights, the mean size and its spread, and how windows are spread.

    Example:
        >>> from descentflow.effects import EFFECTS
        >>> [name for name, effect in EFFECTS.items() if isinstance(effect, DiffersByFlight)]
        ['speed_brake', 'geometric_path']
    """

    own_draws: ClassVar[int]
    """Random numbers by which a flight of a corrected simulator gets its own window and size."""
    holds_rate: ClassVar[bool] = False
    """True if flights that have it fly a rate that thrust, drag and mass do not move."""

    @abstractmethod
    def law_start(self, state: FlightState) -> Tensor:
        """Parameters (k,) of the law from which to start."""

    @abstractmethod
    def windows(self, state: FlightState, theta: Tensor) -> Windows:
        """The windows in which flights may have it.

        Args:
            state: The flights.
            theta: Law.
        """

    def sought_about(self, theta: Tensor) -> "DiffersByFlight":
        """The same effect with the windows among which a law near this one is sought; itself if these are all."""
        return self

    @abstractmethod
    def log_prior(self, state: FlightState, theta: Tensor) -> Tensor:
        """Logarithm (W,) of how often those that have it have it in each window."""

    @abstractmethod
    def size(self, theta: Tensor) -> tuple[float, float, float]:
        """Share of the flights that have it, and mean and spread of the size in those."""

    @abstractmethod
    def learn(self, state: FlightState, theta: Tensor, learnt: Learnt) -> Tensor:
        """The law that flights say."""

    @abstractmethod
    def own_change(self, state: FlightState, theta: Tensor, uniform: Tensor) -> FlightChange:
        """Effect in flights of a corrected simulator, each with its own hypothesis.

        Args:
            state: The simulator's flights, which do not have the effect.
            theta: Parameters (k,) of flights that have it, see :meth:`~descentflow.effects.effect.Effect.mixture`.
            uniform: (n, :attr:`own_draws`) random numbers in [0, 1).
        """

    def is_law(self, theta: Tensor) -> bool:
        """True where flights differ in the effect: some spread is not zero."""
        return any(p.is_spread and value > 0 for p, value in zip(self.parameters, theta.tolist(), strict=True))
