"""Base of an effect: words, parameters and channels, the shift of what is measured, and its correction."""

import math
from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import ClassVar, Literal

import torch
from torch import Tensor

from descentflow.core.units import FT_M, KT_MPS
from descentflow.effects.flight_state import FlightState
from descentflow.effects.scale_group import ScaleGroup

NONE = 0.1
"""Share of a size that matters up to which flights count as having none of an effect."""
AT_BOUND = 1e-6
"""An estimate that is so near to a bound is at it: it was driven there and stopped."""
Shift = Mapping[str, Tensor]
"""Quantity -> change (n, K) at every band, or (n,) for quantities of a whole flight."""
ShownAs = Literal["number", "change", "logarithm", "percent", "flights"]
"""Form of a reported parameter: a number in its unit; a factor, 1 + value (``change``) or e to the value
(``logarithm``), of what its symbol names; percent; or the share of the flights that have the effect.
"""
REPORTED_IN = {"m/s per m": ("kt per 1,000 ft", 1000 * FT_M / KT_MPS)}
"""Unit of a parameter -> aviation unit in which it is reported, and the factor to it."""
NOISE = "noise_"
"""Prefix of names of short-scale noise, which is never a cause: the diagnosis lists it next to them."""
FLOWN = ("rate", "cas", "tas", "wind", "height", "level", "level_gaps", "slow", "missing")
"""Quantities that a simulator's flights have, so that a correction can change them; the others follow from these."""


@dataclass(frozen=True)
class Parameter:
    """One number of an effect, zero where the effect is absent unless ``start`` is set.

    Attributes:
        name: Key of `gap.json`.
        low: Least value that is physically possible.
        high: Largest.
        unit: Unit of the estimate; ``1`` for a plain number.
        scale: A size that matters: steps and practical size are measured in it.
        start: Where a fit starts.
        inexact: Standard error that comes on top of the data's: how well the equations of the effect place it.
        from_heterogeneity: Known by how flights differ, not by their mean.
        is_spread: A spread between flights that have the effect, zero where it is alike in all of them.
        by_product: Effect on the reports themselves: reported with its size, and nothing to enter in a simulator.
        label: What readers call it; the name with spaces if empty.
        shown_as: Form in which it is reported.
        symbol: What stands before the number, such as ``CD0`` before a factor; the label if empty.

    Example:
        >>> Parameter("deviation_k", -40.0, 40.0, "K", 5.0).text
        'deviation k'
        >>> drag = Parameter("relative_change", -0.5, 1.0, "1", 0.05, shown_as="change", symbol="CD0")
        >>> drag.symbol, drag.reported(0.58), drag.reported_unit
        ('CD0', 1.58, 'factor')
        >>> Parameter("deviation_k", -40.0, 40.0, "K", 5.0, label="deviation from the standard atmosphere").text
        'deviation from the standard atmosphere'
    """

    name: str
    low: float
    high: float
    unit: str
    scale: float
    start: float = 0.0
    inexact: float = 0.0
    from_heterogeneity: bool = False
    is_spread: bool = False
    by_product: bool = False
    label: str = ""
    shown_as: ShownAs = "number"
    symbol: str = ""

    @property
    def text(self) -> str:
        """Name for readers."""
        return self.label or self.name.replace("_", " ")

    @property
    def reported_unit(self) -> str:
        """Unit in which it is reported: ``factor``, ``%``, or an aviation unit."""
        if self.shown_as in ("change", "logarithm"):
            return "factor"
        return "%" if self.shown_as in ("percent", "flights") else REPORTED_IN.get(self.unit, (self.unit, 1.0))[0]

    def reported(self, value: float) -> float:
        """A value as reported, in :attr:`reported_unit`."""
        if self.shown_as == "change":
            return 1 + value
        if self.shown_as == "logarithm":
            return math.exp(value)
        return value * (100.0 if self.reported_unit == "%" else REPORTED_IN.get(self.unit, ("", 1.0))[1])


@dataclass(frozen=True)
class FlightChange:
    """Change of a simulator's flights, as :data:`Shift` of some of :data:`FLOWN`.

    Attributes:
        flown: Change of the flight itself: ``rate`` (ln of the rate), ``cas`` (kt), ``tas`` (ln of the TAS), ``wind``
            (m/s along the track, about the flight's mean), ``height`` (m, the same), ``level`` and ``level_gaps``
            (seconds in level-offs and their number, for each flight), ``slow`` and ``missing`` (seconds lost in longer
            gaps, and the share of the levels that they take).
        reported: Change of what is reported of it alone, which takes no time.

    Example:
        >>> late = FlightChange(reported={"rate": torch.zeros(3, 11)})
        >>> list(late.flown), list(late.reported)
        ([], ['rate'])
    """

    flown: Shift = field(default_factory=dict)
    reported: Shift = field(default_factory=dict)


class Effect(ABC):
    """A physical or operational cause: its equation, parameters and words, in a file of its own.

    A subclass needs a ``name``, ``parameters`` and :meth:`shift`; everything else has a default. Quantities that may
    shift: :data:`descentflow.measurements.quantity_registry.QUANTITIES`. A diagnosis runs in torch's inference mode:
    autograd is off.

    Example:
        >>> from descentflow.diagnosis.diagnose import diagnose
        >>> class Ice(Effect):
        ...     name, description = "ice", "more or less drag by ice"
        ...     directions = ("drag by ice", "less drag by ice")
        ...     parameters = (Parameter("drag", -0.2, 0.5, "1", 0.05, label="relative change of the rate by ice"),)
        ...     def shift(self, state, theta):
        ...         return {"rate": theta[0] * (state.altitude_m < 6000).expand_as(state.cas_mps)}
        >>> Ice().in_words(0.1)
        'drag by ice'
        >>> diagnose("descents.parquet", "best.ckpt", catalogue={"ice": Ice()}).verdict
        'none'
    """

    name: ClassVar[str]
    """Key by which the catalogue and `gap.json` name it."""
    parameters: ClassVar[tuple[Parameter, ...]]
    """Its numbers; the first one is its size."""
    label: ClassVar[str] = ""
    """Name for readers; the name with spaces if empty."""
    description: ClassVar[str] = ""
    """Description for readers who are no specialists: 'air warmer or colder than the standard atmosphere'."""
    directions: ClassVar[tuple[str, str] | None] = None
    """Meanings of a positive and a negative first parameter, where these have a name."""
    against: ClassVar[tuple[str, str] | None] = None
    """The same against a simulator whose own flights have some of it, where ``directions`` speak of none."""
    scale_group: ClassVar[ScaleGroup | None] = None
    """Effects of which only ratios can be observed, this one among them."""
    needs: ClassVar[tuple[str, ...]] = ()
    """Channels without which it shows nowhere."""
    splits: ClassVar[tuple[str, ...]] = ()
    """Channels that would tell it from the effects that look like it."""
    sensor: ClassVar[bool] = False
    """True if it changes what is reported and not what is flown."""
    inherited_from: ClassVar[float | None] = None
    """Size of the first parameter from which it shows against physics alone, when the simulator's own flights have it
    too; None where inferred drag hides it then."""
    rate_follows_cas: ClassVar[bool] = False
    """True if a shift of CAS takes the rate along as between flights that fly slower and faster."""

    misfit_of_rate: ClassVar[float] = 0.5
    """Share of its own shift of the rate by which its equation may be off, besides what the aircraft's coefficients
    leave open. Measured on six-degree-of-freedom flights of four types against another type's coefficients: air and
    mass are off by half and more of their few percent; brakes, drag and wind, which have a smaller share, by 5 to 11 %.
    """

    of_coefficients: ClassVar[bool] = False
    """True for a change of the type's coefficients, which `descentflow repair` estimates."""
    is_temperature: ClassVar[bool] = False
    """True if it is the temperature of the air, which a decoder takes for standard."""
    of_air: ClassVar[bool] = False
    """True if it is of the air that a flight meets, which its own reports measure."""

    @property
    def text(self) -> str:
        """Its name for readers."""
        return self.label or self.name.replace("_", " ")

    def in_words(self, size: float | None, *, has_some: bool = False) -> str:
        """Description with the direction that the first parameter gives; the name where the class has no words.

        Args:
            size: Estimate of the first parameter; None where the data say nothing of it.
            has_some: Whether the simulator's own flights have some of it: sizes are differences to those.

        Example:
            >>> from descentflow.effects import EFFECTS
            >>> EFFECTS["temperature"].in_words(-4.0)
            'air colder than the standard atmosphere'
            >>> EFFECTS["temperature"].in_words(None)
            'air warmer or colder than the standard atmosphere'
        """
        words = (self.against if has_some else None) or self.directions
        if words is None or size is None:
            return self.description or self.text
        return words[0 if size > 0 else 1]

    def recipe(self, sizes: Mapping[str, str]) -> str:
        """Settings that give a simulator the effect; levels and the share of the flights come after them.

        Args:
            sizes: By parameter, the report of its size in the flights that have the effect.

        Example:
            >>> from descentflow.effects import EFFECTS
            >>> EFFECTS["temperature"].recipe({"deviation_k": "ISA +7.2 K (+6.8 to +7.6)"})
            'ISA +7.2 K (+6.8 to +7.6)'
            >>> EFFECTS["vertical_rate_lag"].recipe({"lag_s": "lag 8 s (7 to 9)"})
            'in what is reported: lag 8 s (7 to 9)'
        """
        text = "; ".join(sizes.values())
        return f"in what is reported: {text}" if self.sensor and text else text

    @abstractmethod
    def shift(self, state: FlightState, theta: Tensor) -> Shift:
        """Change of the measured quantities at parameters theta (k,), smooth in theta."""

    def change(self, state: FlightState, theta: Tensor) -> FlightChange:
        """Part of the shift that a corrected simulator's flights have: what a simulator flies or reports.

        Args:
            state: The simulator's flights, which do not have the effect (``affected`` is false).
            theta: Parameters (k,) of a flight that has it, see :meth:`mixture`.

        Example:
            >>> from descentflow.effects import EFFECTS
            >>> from descentflow.effects._example_flights import example_flights
            >>> warmer = EFFECTS["temperature"].change(example_flights(), torch.tensor([10.0]))
            >>> sorted(warmer.flown), sorted(warmer.reported)
            (['height', 'rate', 'tas'], [])
        """
        shift = self.shift(state, theta)
        part = {quantity: value for quantity, value in shift.items() if quantity in FLOWN}
        return FlightChange(reported=part) if self.sensor else FlightChange(flown=part)

    def measured(self, state: FlightState, shown: Shift) -> Tensor | None:
        """Parameters (k,) that flights of one side show by themselves, compared with physics and no other flights.

        Args:
            state: Flights of that side.
            shown: Quantities of them, (n, K), NaN where not seen.

        Returns:
            None where nothing reported measures them, the default.
        """
        return None

    def start(self) -> Tensor:
        """Parameters (k,) from which a fit starts."""
        return torch.tensor([p.start for p in self.parameters], dtype=torch.float64)

    def plausible(self, state: FlightState, theta: Tensor) -> bool:
        """True where parameters can be real: an estimate driven to a bound other than zero cannot.

        A spread between flights may be at its upper bound: all flights have the effect.
        """
        return all(
            value == 0.0 or (value > p.low + AT_BOUND and (p.from_heterogeneity or value < p.high - AT_BOUND))
            for p, value in zip(self.parameters, theta.tolist(), strict=True)
        )

    def may_be(self, state: FlightState, theta: Tensor) -> tuple[str, ...]:
        """Other effects of the catalogue that look like these parameters, for lack of the channels that they need.

        None of them is then named, this one neither: no measurement decides which it is.
        """
        return ()

    def mixture(self, theta: Tensor) -> tuple[float, Tensor]:
        """Share of the flights that have the effect, and its parameters in those.

        One where all have it alike, or where the parameters do not say how many have it.
        """
        return 1.0, theta

    def clamp(self, theta: Tensor) -> Tensor:
        """Parameters within their physical bounds.

        Example:
            >>> from descentflow.effects import EFFECTS
            >>> EFFECTS["temperature"].clamp(torch.tensor([55.0]))
            tensor([40.])
        """
        low = torch.tensor([p.low for p in self.parameters], dtype=theta.dtype)
        high = torch.tensor([p.high for p in self.parameters], dtype=theta.dtype)
        return torch.minimum(torch.maximum(theta, low), high)
