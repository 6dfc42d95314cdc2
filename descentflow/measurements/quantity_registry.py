"""Every quantity that is measured of a flight: its name, what readers call it and its unit."""

from dataclasses import dataclass

from descentflow.core.files import table_beside


@dataclass(frozen=True)
class MeasuredQuantity:
    """One quantity.

    Attributes:
        name: Key by which effects shift it and `gap.json` names it.
        label: What readers call it.
        unit: Unit of its differences; ``1`` for a plain number.
        meaning: What is measured.
        by_band: Whether there is one number for each band of altitude; else one for each flight.
        is_count: A count or a time lost, zero for most flights.
        channel: Whose short-scale noise it is; empty for other quantities.

    Example:
        >>> QUANTITIES["lag"].label, QUANTITIES["cas"].unit
        ('reported rate against altitude over time', 'kt')
    """

    name: str
    label: str
    unit: str
    meaning: str
    by_band: bool = False
    is_count: bool = False
    channel: str = ""

    @property
    def is_noise(self) -> bool:
        """True for the short-scale noise of a channel."""
        return bool(self.channel)


QUANTITIES = {name: MeasuredQuantity(name, **quantity) for name, quantity in table_beside(__file__).items()}
"""Quantities that may differ between flights, by name: those of a band first, in the order of comparison."""
BY_BAND = tuple(name for name, quantity in QUANTITIES.items() if quantity.by_band)
"""Quantities with a number for each band of altitude."""
NOISE_CHANNELS = {name: quantity.channel for name, quantity in QUANTITIES.items() if quantity.is_noise}
"""Short-scale noise -> the channel that has it."""
OF_FLIGHT = tuple(name for name, quantity in QUANTITIES.items() if not quantity.by_band)
"""Quantities with one number for each flight."""
CHANNELS = ("IAS", "Mach", "vertical_rate", "TAS", "groundspeed", "track", "heading", "geoaltitude")
"""Channels that a diagnosis can use."""
SHOWN_BY = {"TAS": "tas", "geoaltitude": "height", "groundspeed": "wind", "Mach": "mismatch"}
"""Channel -> a quantity that cannot be measured without it; the one most often worth adding first."""


def label_of(name: str) -> str:
    """Name of a quantity for readers; its own name where it is not among ours.

    Example:
        >>> label_of("tas")
        'true airspeed against Mach number'
    """
    return QUANTITIES[name].label if name in QUANTITIES else name
