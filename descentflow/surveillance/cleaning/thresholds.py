"""Thresholds of the cleaning that a user sets, with their meanings; `configs/prepare/default.yaml` has their sources.

The numbers of the methods themselves, which are no options, stand where they are used.
"""

import dataclasses
from collections.abc import Mapping
from dataclasses import asdict, dataclass, fields
from typing import Any

from docstring_parser import parse_from_object

from descentflow.core.errors import ConfigError


@dataclass(frozen=True)
class Cleaning:
    """Thresholds of the cleaning; `None` switches an optional filter off.

    Example:
        >>> Cleaning(bottom_fl=100).slowest_fpm
        500.0
    """

    bottom_fl: int = 150
    """Lowest flight level of the grid."""
    flight_gap_s: float = 900.0
    """Silence after which an address is another flight, s."""
    spike_altitude_ft: float = 300.0
    """Smallest spike of altitude, ft."""
    spike_ias_kt: float = 15.0
    """Smallest spike of IAS, kt."""
    spike_mach: float = 0.03
    """Smallest spike of Mach."""
    spike_rate_fpm: float = 1500.0
    """Smallest spike of vertical rate, ft/min."""
    fastest_altitude_ftps: float = 100.0
    """Growth of the smallest spike of altitude per second at the ends of a flight, where neighbours are on one side
    only, ft/s."""
    fastest_ias_ktps: float = 2.0
    """Growth of the smallest spike of IAS per second at the ends of a flight, kt/s."""
    fastest_mach_ps: float = 0.003
    """Growth of the smallest spike of Mach per second at the ends of a flight, 1/s."""
    fastest_rate_fpmps: float = 100.0
    """Growth of the smallest spike of vertical rate per second at the ends of a flight, ft/min/s."""
    spike_agreeing_kt: float = 8.0
    """IAS and Mach that agree within this (as CAS) are no spikes, kt."""
    stale_s: float = 20.0
    """Shortest repetition of one value that is compared with the other channels, s."""
    stale_altitude_ft: float = 300.0
    """Altitude is repeated while the rate integrates to this much, or the rate while the altitude changes by this much
    more or less, ft."""
    stale_ias_kt: float = 8.0
    """IAS is repeated while the CAS of Mach and altitude changes by this, kt."""
    stale_mach: float = 0.02
    """Mach is repeated while the Mach number of IAS and altitude changes by this."""
    airspeeds_differ_kt: float = 25.0
    """Largest difference of IAS and the CAS of Mach and altitude, kt."""
    slowest_fpm: float = 500.0
    """Slowest rate that counts as descent, ft/min."""
    transient_s: float = 20.0
    """Time dropped before and after level flight, s."""
    constant_rate_s: float = 50.0
    """Shortest constant-rate segment that begins and ends with a sudden change of rate, s."""
    constant_rate_alone_s: float = 180.0
    """Shortest constant-rate segment without such a change, s."""
    constant_rate_gradient: float = 0.04
    """Steepest gradient in still air of a constant-rate segment that no sudden steepening ends."""
    constant_rate_jump_fpm: float = 150.0
    """Smallest sudden change of rate at the begin or end of a constant-rate segment, ft/min."""
    constant_rate_drift_fpm: float = 80.0
    """Largest drift of the rate over a constant-rate segment, ft/min."""
    constant_rate_scatter_fpm: float = 64.0
    """Largest standard deviation of the rate in a constant-rate segment, ft/min."""
    constant_rate_offset_fpm: float = 25.0
    """Largest distance of a constant-rate segment's mean rate from a multiple of 100 ft/min, ft/min."""
    cleared_speed_after_s: float | None = 30.0
    """Drop rows under an assigned speed or Mach number, where clearances are known, and for this long after, s; none
    keeps them."""
    cleared_speed_within_kt: float = 10.0
    """An assigned speed that the flight never comes this close to is no constraint (`or less`, `or greater`), kt."""
    idle_only: float | None = None
    """Drop rows whose power is further above idle than this, where N1, thrust or fuel flow is known, percentage points
    of N1 (4 % of idle fuel flow, 1 % of the greatest thrust each); none keeps them."""
    climb_back_ft: float = 1000.0
    """Climb that separates two descents of a flight (go-around), of which the larger is kept, ft."""
    longest_gap_s: float = 60.0
    """Longest gap between reports that is bridged, s."""
    highest_gap_ft: float = 3000.0
    """Highest gap between reports that is bridged, ft."""
    hidden_gap_s: float = 10.0
    """Gap in which no level-off can hide: over a longer one the mean rate must be that of a descent, s."""
    fewest_levels: int = 20
    """Shortest descent kept, in flight levels."""

    def __post_init__(self) -> None:
        """Check what was given, as :func:`cleaning_of` does."""
        for field in dataclasses.fields(self):
            object.__setattr__(self, field.name, _checked(getattr(self, field.name), field, "Cleaning"))


def meaning_of(name: str) -> str:
    """Meaning of a threshold with its unit.

    Example:
        >>> meaning_of("slowest_fpm")
        'slowest rate that counts as descent, ft/min'
    """
    text = next(param.description for param in parse_from_object(Cleaning).params if param.arg_name == name) or ""
    words = " ".join(text.split()).removesuffix(".")
    return words if words[:2].isupper() else words[:1].lower() + words[1:]


def cleaning_of(settings: Mapping[str, Any], origin: str) -> Cleaning:
    """Thresholds by name, checked; names that are absent keep their defaults.

    Raises:
        ConfigError: If a name is unknown, or a value is not a number of its kind, or negative.

    Example:
        >>> cleaning_of({"bottom_fl": 100}, "--config").bottom_fl
        100
    """
    fields = {field.name: field for field in dataclasses.fields(Cleaning)}
    unknown = sorted(map(str, set(settings) - set(fields)))
    if unknown:
        raise ConfigError(
            f"{origin}: no threshold {', '.join(unknown)}",
            expected=f"some of {', '.join(fields)}",
            mend="see configs/prepare/default.yaml",
        )
    checked: dict[str, Any] = {name: _checked(value, fields[name], origin) for name, value in settings.items()}
    return Cleaning(**checked)


def _checked(value: object, field: "dataclasses.Field[Any]", origin: str) -> int | float | None:
    whole = isinstance(field.default, int)
    if value is None and "None" in str(field.type):
        return None
    # 280.0 is FL280: kept as it is, no reader of the descents would take it for a level.
    if (
        isinstance(value, int | float)
        and not isinstance(value, bool)
        and 0 <= value < 1e9
        and not (whole and value % 1)
    ):
        return int(value) if whole else float(value)
    raise ConfigError(
        f"{origin}: {field.name} is {value!r}",
        expected=f"a {'whole ' if whole else ''}number of zero or more ({meaning_of(field.name)})",
        mend=f"the default is {field.default}",
    )


def kept_cleaning(settings: object) -> Cleaning | None:
    """The thresholds that a prepared file or a checkpoint was made with."""
    # Files that were made before there was such a rule lack its name.
    names = {field.name for field in fields(Cleaning)} - {"idle_only"}
    if not isinstance(settings, Mapping) or not names <= set(settings):
        return None
    # Rules that are gone change nothing where they were off.
    known = {name: value for name, value in settings.items() if value is not None or name in names}
    try:
        return cleaning_of(known, "kept settings")
    except ConfigError:
        return None


def different_settings(first: Cleaning, second: Cleaning) -> dict[str, tuple[Any, Any]]:
    """Thresholds that differ between two cleanings, each with both values."""
    values, others = asdict(first), asdict(second)
    return {name: (values[name], others[name]) for name in values if values[name] != others[name]}


def differences_in_words(settings: Mapping[str, Cleaning]) -> str:
    """Each setting that differs between two cleanings, with both values and names; empty for one alone."""
    if len(settings) < 2:
        return ""
    (first, one), (second, other) = settings.items()
    values = {
        name: ["off" if value is None else f"{value:g}" for value in both]
        for name, both in different_settings(one, other).items()
    }
    return ", ".join(f"{name} is {there} in {second} and {here} in {first}" for name, (here, there) in values.items())
