"""Every threshold of the cleaning with its meaning and source: one table for the library, the options and the YAML.

:class:`Cleaning` holds what a user sets; :class:`Fixed` holds the numbers of the methods themselves, which are no
options.
"""

import dataclasses
from collections.abc import Mapping
from dataclasses import asdict, dataclass, fields
from typing import Any

from descentflow.core.errors import ConfigError


def _threshold(default: Any, meaning: str, source: str) -> Any:
    """A field of :class:`Cleaning` with its meaning (and unit), and where its default comes from."""
    return dataclasses.field(default=default, metadata={"meaning": meaning, "source": source})


HAMPEL_FILTER = "a Hampel filter (Hampel 1974, JASA 69) over five reports; "
FASTEST_CHANGE = "the fastest change of a transport aircraft: "
MEASURED_RATES = "measured on 1,500 simulated flights and an hour of real ones over the Netherlands; see ConstantRate"
STALE_REGISTER = "a register that its aircraft, or the receiver, no longer refreshes; "


@dataclass(frozen=True)
class Cleaning:
    """Thresholds of the cleaning; `None` switches an optional filter off.

    Example:
        >>> Cleaning(bottom_fl=100).slowest_fpm
        500.0
        >>> describe("transient_s")[0]
        'time dropped before and after level flight, s'
    """

    bottom_fl: int = _threshold(
        150, "lowest flight level of the grid", "paper, section 2.2: below FL150 arrivals are procedural"
    )
    flight_gap_s: float = _threshold(
        900.0,
        "silence after which an address is another flight, s",
        "15 min: longer than any gap of reception en route, shorter than any turnaround of an airliner",
    )
    spike_altitude_ft: float = _threshold(
        300.0,
        "smallest spike of altitude, ft",
        HAMPEL_FILTER + "three steps of a 100 ft encoder: quantisation is never a spike",
    )
    spike_ias_kt: float = _threshold(
        15.0, "smallest spike of IAS, kt", HAMPEL_FILTER + "15 steps of 1 kt; gusts stay below"
    )
    spike_mach: float = _threshold(0.03, "smallest spike of Mach", HAMPEL_FILTER + "7 steps of 0.004 (BDS 6,0)")
    spike_rate_fpm: float = _threshold(
        1500.0,
        "smallest spike of vertical rate, ft/min",
        HAMPEL_FILTER + "23 steps of 64 ft/min; turbulence stays below",
    )
    fastest_altitude_ftps: float = _threshold(
        100.0,
        "added per second at the ends of a flight, where a spike has neighbours on one side only, ft/s",
        FASTEST_CHANGE + "6,000 ft/min",
    )
    fastest_ias_ktps: float = _threshold(2.0, "the same of IAS, kt/s", FASTEST_CHANGE + "0.1 g")
    fastest_mach_ps: float = _threshold(0.003, "the same of Mach, 1/s", FASTEST_CHANGE + "0.1 g at 300 m/s")
    fastest_rate_fpmps: float = _threshold(
        100.0, "the same of vertical rate, ft/min/s", FASTEST_CHANGE + "0.05 g across the path"
    )
    spike_agreeing_kt: float = _threshold(
        8.0,
        "IAS and Mach that agree within this (as CAS) are no spikes, kt",
        "seen in real flights: sparse reports of an aircraft that accelerates and slows down; four steps of 0.004 Mach",
    )
    stale_s: float = _threshold(
        20.0,
        "shortest repetition of one value that is compared with the other channels, s",
        STALE_REGISTER + "receivers drop a register after some 60 s, radars refresh one in 5 to 15 s",
    )
    stale_altitude_ft: float = _threshold(
        300.0,
        "altitude is repeated while the rate integrates to this much, or the rate while the altitude changes by this "
        "much more or less, ft",
        STALE_REGISTER
        + "three steps of a 100 ft encoder; also 10 % of the height, for rates of inertial height in warm air",
    )
    stale_ias_kt: float = _threshold(
        8.0,
        "IAS is repeated while the CAS of Mach and altitude changes by this, kt",
        STALE_REGISTER + "four steps of 0.004 Mach at FL150 (2.1 kt each); 1,700 ft at a constant Mach number",
    )
    stale_mach: float = _threshold(
        0.02,
        "Mach is repeated while the Mach number of IAS and altitude changes by this",
        STALE_REGISTER + "five steps of 0.004, seven of 1 kt at FL350 (0.0027 each)",
    )
    airspeeds_differ_kt: float = _threshold(
        25.0,
        "largest difference of IAS and the CAS of Mach and altitude, kt",
        "position and instrument error (some 5 kt), quantisation (3 kt) and seconds between registers are smaller; "
        "a register decoded as another does not",
    )
    slowest_fpm: float = _threshold(
        500.0, "slowest rate that counts as descent, ft/min", "paper, section 3: level-offs and climbs are dropped"
    )
    transient_s: float = _threshold(
        20.0,
        "time dropped before and after level flight, s",
        "paper, section 3 (transients); a transport aircraft settles into a descent within some 20 s at 0.05 to 0.1 g",
    )
    constant_rate_s: float = _threshold(
        50.0, "shortest constant-rate segment that begins and ends with a sudden change of rate, s", MEASURED_RATES
    )
    constant_rate_alone_s: float = _threshold(
        180.0, "shortest constant-rate segment without such a change, s", MEASURED_RATES
    )
    constant_rate_gradient: float = _threshold(
        0.04,
        "steepest gradient in still air of a constant-rate segment that no sudden steepening ends",
        "best glide ratios of airliners, 17 to 20, and idle thrust: idle is steeper; see ConstantRate",
    )
    constant_rate_jump_fpm: float = _threshold(
        150.0, "smallest sudden change of rate at the begin or end of a constant-rate segment, ft/min", MEASURED_RATES
    )
    constant_rate_drift_fpm: float = _threshold(
        80.0, "largest drift of the rate over a constant-rate segment, ft/min", MEASURED_RATES
    )
    constant_rate_scatter_fpm: float = _threshold(
        64.0,
        "largest standard deviation of the rate in a constant-rate segment, ft/min",
        MEASURED_RATES + "; one step of a rate in BDS 6,0 is 32",
    )
    constant_rate_offset_fpm: float = _threshold(
        25.0,
        "largest distance of a constant-rate segment's mean rate from a multiple of 100 ft/min, ft/min",
        MEASURED_RATES,
    )
    cleared_speed_after_s: float | None = _threshold(
        30.0,
        "drop rows under an assigned speed or Mach number, where clearances are known, and for this long after, s; "
        "none keeps them",
        "paper, section 3: flights without speed constraints; 30 kt are regained in 30 s at 1 kt/s",
    )
    cleared_speed_within_kt: float = _threshold(
        10.0,
        "an assigned speed that the flight never comes this close to is no constraint (`or less`, `or greater`), kt",
        "ICAO Doc 4444, 4.6.1.4: speeds are instructed in steps of 10 kt; a SCAT flight descends at 260 kt under 280",
    )
    climb_back_ft: float = _threshold(
        1000.0,
        "climb that separates two descents of a flight (go-around), of which the larger is kept, ft",
        "a missed approach climbs by thousands of feet, a step of an encoder by 100",
    )
    longest_gap_s: float = _threshold(
        60.0, "longest gap between reports that is bridged, s", "twice the slowest source's interval (30 s snapshots)"
    )
    highest_gap_ft: float = _threshold(
        3000.0, "highest gap between reports that is bridged, ft", "60 s at 3,000 ft/min: the fastest clean descents"
    )
    hidden_gap_s: float = _threshold(
        10.0,
        "gap in which no level-off can hide: over a longer one the mean rate must be that of a descent, s",
        "leaving a descent, levelling off and entering it again takes longer",
    )
    fewest_levels: int = _threshold(
        20, "shortest descent kept, in flight levels", "2,000 ft: a minute of descent, above what a spike can feign"
    )

    def __post_init__(self) -> None:
        """Check what was given, as :func:`cleaning_of` does."""
        for one in dataclasses.fields(self):
            object.__setattr__(self, one.name, _checked(getattr(self, one.name), one, "Cleaning"))


@dataclass(frozen=True)
class Fixed:
    """Numbers of the cleaning's methods that are no options; used as `Fixed.hampel_rows`."""

    altitude_step_ft: float = _threshold(25.0, "step of reported altitude, ft", "Mode S and ADS-B: ICAO Doc 9871")
    hampel_rows: int = _threshold(5, "reports in the window of a Hampel filter", "Hampel 1974, JASA 69")
    hampel_deviations: float = _threshold(
        3.0, "robust standard deviations from the median that make a spike", "Hampel 1974, JASA 69"
    )
    mach_per_kt: float = _threshold(
        0.002,
        "Mach number that counts as much as 1 kt of an assigned speed",
        "1 kt is 0.0019 Mach at FL150, 0.0027 at FL350",
    )
    stale_rate_fpm: float = _threshold(
        100.0,
        "rate by which altitude and reported rate may differ for any time, ft/min",
        STALE_REGISTER + "steps of 64 ft/min and their bias",
    )
    stale_height_share: float = _threshold(
        0.1,
        "share of the height by which they may differ besides",
        STALE_REGISTER + "inertial rates in air 25 K off the standard atmosphere differ by a tenth",
    )
    rate_windows_s: tuple[float, ...] = _threshold(
        (5.0, 10.0, 20.0, 30.0, 60.0),
        "half-widths of the windows in which a missing rate is fitted, tried in turn, s",
        "sources report every second to every 30 s",
    )
    rate_error_fpm: float = _threshold(
        50.0, "largest standard error of a fitted rate, ft/min", "below the 64 ft/min in which ADS-B reports rates"
    )
    contradicting_share: float = _threshold(
        0.5,
        "share of the rows in which IAS contradicts Mach above which all are refused",
        "then the column is wrong, not its rows; real sources have 0.001 at most",
    )
    constant_rate_step_fpm: float = _threshold(
        100.0, "step of the vertical rate that a pilot can select, ft/min", "flight control units of Airbus and Boeing"
    )
    constant_rate_side_s: float = _threshold(20.0, "time of the mean rates beside a sudden change, s", MEASURED_RATES)
    constant_rate_turn_s: float = _threshold(
        4.0, "time left out on either side of a sudden change, s", MEASURED_RATES + "; the aircraft enters its new path"
    )
    constant_rate_settle_s: float = _threshold(
        10.0, "time left out at both ends of a judged segment, s", MEASURED_RATES
    )
    constant_rate_side_reports: int = _threshold(3, "fewest reports on either side of a sudden change", MEASURED_RATES)
    constant_rate_reports: int = _threshold(6, "fewest reports of a segment that is judged", MEASURED_RATES)


def describe(name: str) -> tuple[str, str]:
    """Meaning and source of a threshold.

    Example:
        >>> describe("slowest_fpm")
        ('slowest rate that counts as descent, ft/min', 'paper, section 3: level-offs and climbs are dropped')
    """
    meta = {field.name: field.metadata for kind in (Cleaning, Fixed) for field in dataclasses.fields(kind)}[name]
    return meta["meaning"], meta["source"]


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
        expected=f"a {'whole ' if whole else ''}number of zero or more ({field.metadata['meaning']})",
        mend=f"the default is {field.default}",
    )


def kept_cleaning(settings: object) -> Cleaning | None:
    """The thresholds that a prepared file or a checkpoint was made with."""
    names = {field.name for field in fields(Cleaning)}
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
