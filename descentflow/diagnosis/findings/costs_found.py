"""Costs of a gap, in aviation units: seconds, nautical miles, feet per minute, knots."""

from collections.abc import Sequence
from dataclasses import dataclass

NINETY = 1.645
"""Standard errors on either side of a 90 % interval."""
COST_LABELS = {
    "time": ("time", "s"),
    "time_at_speed": ("time at equal speed", "s"),
    "air_distance": ("distance through the air", "NM"),
    "ground_distance": ("distance over ground", "NM"),
    "rate": ("rate of descent", "ft/min"),
    "time_in_own_air": ("time at equal speed, in own air", "s"),
    "rate_in_own_air": ("rate of descent, in own air", "ft/min"),
    "cas": ("calibrated airspeed", "kt"),
    "tas": ("true airspeed", "kt"),
    "fuel": ("fuel", "kg"),
    "level": ("time lost in level-offs", "s"),
    "slow": ("time lost in slow stretches", "s"),
}
"""Cost -> its name for readers and its unit."""
CLOSED = {"time_at_speed": "time_in_own_air", "rate": "rate_in_own_air"}
"""Costs by which causes are judged, and what they are in the air that each flight met."""


@dataclass(frozen=True)
class Measured:
    """A number with its 90 % interval; no ends where none is claimed.

    Example:
        >>> Measured(12.0, 10.5, 13.4).estimate
        12.0
    """

    estimate: float
    low: float | None = None
    high: float | None = None

    @property
    def ends(self) -> tuple[float, ...]:
        """Both ends of the interval; empty where none is claimed."""
        return () if self.low is None or self.high is None else (self.low, self.high)

    @property
    def excludes_zero(self) -> bool:
        """True if the interval leaves no room for zero; false where there is none.

        Example:
            >>> Measured(12.0, 10.5, 13.4).excludes_zero, Measured(1.0, -0.5, 2.0).excludes_zero
            (True, False)
        """
        return bool(self.ends) and not self.ends[0] <= 0 <= self.ends[1]


@dataclass(frozen=True)
class Cost:
    """Cost of the gap in one quantity between two flight levels: the flights' mean minus the simulator's.

    Attributes:
        name: ``time``, ``distance``, ``rate``, ``cas`` or ``tas``.
        label: What readers call it.
        unit: ``s``, ``NM``, ``ft/min`` or ``kt``.
        low_fl: Lower end of the levels.
        high_fl: Upper end.
        simulator: Mean of the simulator, in ``unit``.
        flights: Mean of the flights.
        before: Flights minus simulator.
        after: The same once the named causes are in the simulator; None where none is named.
        floor: Size that nine of ten pairs of samples of one population stay below.

    Example:
        >>> cost = Cost("time", "time", "s", 150.0, 370.0, 520.0, 545.0, Measured(25.0, 22.0, 28.0), None, 3.0)
        >>> cost.before.estimate == cost.flights - cost.simulator
        True
    """

    name: str
    label: str
    unit: str
    low_fl: float
    high_fl: float
    simulator: float
    flights: float
    before: Measured
    after: Measured | None
    floor: float


def judged(costs: Sequence[Cost]) -> list[Cost]:
    """Costs over all levels by which causes are judged: in each flight's own air where the air is a cause.

    Example:
        >>> none = Measured(0.0)
        >>> names = ("time", "time_at_speed", "time_in_own_air")
        >>> time = [Cost(name, "", "s", 150, 370, 500, 500, none, none, 3.0) for name in names]
        >>> [cost.name for cost in judged(time[:2])], [cost.name for cost in judged(time)]
        (['time_at_speed'], ['time_in_own_air'])
    """
    whole = {cost.name: cost for cost in reversed(costs)}
    names = [name for name in CLOSED.values() if name in whole] or list(CLOSED)
    return [whole[name] for name in names if name in whole]


@dataclass(frozen=True)
class LevelMeans:
    """Means of the simulator in a band of altitude: relative differences become ft/min and kt by it.

    Example:
        >>> LevelMeans(157.5, rate_fpm=2100.0, cas_kt=280.0, tas_kt=352.0).rate_fpm
        2100.0
    """

    level_fl: float
    rate_fpm: float
    cas_kt: float
    tas_kt: float
