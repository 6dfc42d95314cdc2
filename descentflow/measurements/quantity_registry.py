"""Every quantity that is measured of a flight: its name, what readers call it and its unit."""

from dataclasses import dataclass


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
        is_noise: Short-scale noise of a channel.

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
    is_noise: bool = False


def _noise(name: str, label: str, unit: str) -> MeasuredQuantity:
    meaning = f"ln of the short-scale {label} ({unit})" if unit else f"ln of the short-scale {label}"
    return MeasuredQuantity(name, label, "ln", meaning, is_noise=True)


QUANTITIES: dict[str, MeasuredQuantity] = {
    quantity.name: quantity
    for quantity in (
        MeasuredQuantity(
            "rate", "rate of descent", "relative", "ln of the rate of descent over the polar's", by_band=True
        ),
        MeasuredQuantity(
            "lag",
            "reported rate against altitude over time",
            "relative",
            "ln of the reported rate over the differenced altitude's",
            by_band=True,
        ),
        MeasuredQuantity("cas", "calibrated airspeed", "kt", "calibrated airspeed, kt", by_band=True),
        MeasuredQuantity(
            "mismatch",
            "IAS against Mach number",
            "kt",
            "IAS minus the CAS of the Mach number, kt",
            by_band=True,
        ),
        MeasuredQuantity(
            "tas",
            "true airspeed against Mach number",
            "relative",
            "ln of TAS over that of the Mach number in standard air",
            by_band=True,
        ),
        MeasuredQuantity(
            "wind",
            "change of the along-track wind",
            "m/s",
            "along-track wind minus the flight's mean, m/s",
            by_band=True,
        ),
        MeasuredQuantity(
            "height",
            "geometric against pressure altitude",
            "m",
            "geometric minus pressure altitude, minus the flight's mean, m",
            by_band=True,
        ),
        _noise("noise_rate", "noise of the vertical rate", "ft/min"),
        _noise("noise_cas", "noise of IAS", "kt"),
        _noise("noise_mach", "noise of Mach", ""),
        _noise("noise_tas", "noise of TAS", "kt"),
        _noise("noise_groundspeed", "noise of groundspeed", "kt"),
        _noise("noise_altitude", "noise of altitude", "m"),
        MeasuredQuantity("level", "time in level-offs", "s", "time lost in short gaps of altitude, s", is_count=True),
        MeasuredQuantity("level_gaps", "number of level-offs", "1", "number of short gaps of altitude", is_count=True),
        MeasuredQuantity(
            "slow", "time in slow stretches", "s", "time lost in longer gaps of altitude, s", is_count=True
        ),
        MeasuredQuantity(
            "missing",
            "levels cut out as managed",
            "1",
            "share of the levels that longer gaps of altitude took",
            is_count=True,
        ),
    )
}
"""Quantities that may differ between flights, by name: those of a band first, in the order of comparison."""
BY_BAND = tuple(name for name, quantity in QUANTITIES.items() if quantity.by_band)
"""Quantities with a number for each band of altitude."""
NOISE_CHANNELS = {
    "noise_rate": "vertical_rate",
    "noise_cas": "IAS",
    "noise_mach": "Mach",
    "noise_tas": "TAS",
    "noise_groundspeed": "groundspeed",
    "noise_altitude": "altitude",
}
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
