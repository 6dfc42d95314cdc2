"""Every threshold of the cleaning with its reason and source: one table for the library, the options and the YAML."""

import dataclasses
import textwrap
from collections.abc import Mapping
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Any

from descentflow.core.errors import ConfigError


def threshold(default: Any, meaning: str, source: str) -> Any:
    """A field of :class:`Cleaning` with its meaning (and unit), and where its default comes from."""
    return dataclasses.field(default=default, metadata={"meaning": meaning, "source": source})


HAMPEL = "a Hampel filter (Hampel 1974, JASA 69) over five reports; "
ENDS = "the fastest change of a transport aircraft: "
HELD = "measured on 1,500 world flights and an hour of real ones over the Netherlands; see free_rate.py"
STALE = "a register that its aircraft, or the receiver, no longer refreshes; "


@dataclass(frozen=True)
class Cleaning:
    """Thresholds of the cleaning; `None` switches an optional filter off.

    Example:
        >>> Cleaning(bottom_fl=100).slowest_fpm
        500.0
        >>> describe("transient_s")[0]
        'what is dropped on either side of level flight, s'
    """

    bottom_fl: int = threshold(
        150, "lowest flight level of the grid", "paper, section 2.2: below FL150 arrivals are procedural"
    )
    flight_gap_s: float = threshold(
        900.0,
        "silence after which an address is another flight, s",
        "15 min: longer than any gap of reception en route, shorter than any turnaround of an airliner",
    )
    spike_altitude_ft: float = threshold(
        300.0,
        "smallest spike of altitude, ft",
        HAMPEL + "three steps of a 100 ft encoder: quantisation is never a spike",
    )
    spike_ias_kt: float = threshold(15.0, "smallest spike of IAS, kt", HAMPEL + "15 steps of 1 kt; gusts stay below")
    spike_mach: float = threshold(0.03, "smallest spike of Mach", HAMPEL + "7 steps of 0.004 (BDS 6,0)")
    spike_rate_fpm: float = threshold(
        1500.0, "smallest spike of vertical rate, ft/min", HAMPEL + "23 steps of 64 ft/min; turbulence stays below"
    )
    fastest_altitude_ftps: float = threshold(
        100.0,
        "added for each second at the ends of a flight, where no middle shows a spike, ft/s",
        ENDS + "6,000 ft/min",
    )
    fastest_ias_ktps: float = threshold(2.0, "the same of IAS, kt/s", ENDS + "0.1 g")
    fastest_mach_ps: float = threshold(0.003, "the same of Mach, 1/s", ENDS + "0.1 g at 300 m/s")
    fastest_rate_fpmps: float = threshold(100.0, "the same of vertical rate, ft/min/s", ENDS + "0.05 g across the path")
    spike_agreeing_kt: float = threshold(
        8.0,
        "IAS and Mach that agree within this (as CAS) are no spikes, kt",
        "seen in real flights: sparse reports of an aircraft that hurries and slows down; four steps of 0.004 Mach",
    )
    stale_s: float = threshold(
        20.0,
        "shortest repetition of one value that is held against the other channels, s",
        STALE + "receivers drop a register after some 60 s, radars refresh one in 5 to 15 s",
    )
    stale_altitude_ft: float = threshold(
        300.0,
        "altitude stands still while the rate makes this much, or the rate while the altitude makes this much more or "
        "less, ft",
        STALE + "three steps of a 100 ft encoder; also 10 % of the height, for rates of inertial height in warm air",
    )
    stale_ias_kt: float = threshold(
        8.0,
        "IAS stands still while the CAS of Mach and altitude moves by this, kt",
        STALE + "four steps of 0.004 Mach at FL150 (2.1 kt each); 1,700 ft at a constant Mach number",
    )
    stale_mach: float = threshold(
        0.02,
        "Mach stands still while the Mach number of IAS and altitude moves by this",
        STALE + "five steps of 0.004, seven of 1 kt at FL350 (0.0027 each)",
    )
    airspeeds_differ_kt: float = threshold(
        25.0,
        "largest difference of IAS and the CAS of Mach and altitude, kt",
        "position and instrument error (some 5 kt), quantisation (3 kt) and seconds between two registers stay below; "
        "a register decoded as another does not",
    )
    slowest_fpm: float = threshold(
        500.0, "slowest rate that counts as descent, ft/min", "paper, section 3: level-offs and climbs go"
    )
    transient_s: float = threshold(
        20.0,
        "what is dropped on either side of level flight, s",
        "paper, section 3 (transients); a transport aircraft settles into a descent within some 20 s at 0.05 to 0.1 g",
    )
    constant_rate_s: float = threshold(
        50.0, "shortest managed stretch, where a rate is selected at once, held, and given up, s", HELD
    )
    constant_rate_alone_s: float = threshold(
        180.0, "shortest managed stretch where the rate is held, but no change to it is seen, s", HELD
    )
    constant_rate_jump_fpm: float = threshold(
        150.0, "smallest change of rate at the begin or end of a managed stretch, ft/min", HELD
    )
    constant_rate_drift_fpm: float = threshold(80.0, "largest drift of the rate over a managed stretch, ft/min", HELD)
    constant_rate_scatter_fpm: float = threshold(
        64.0, "largest scatter of the rate in a managed stretch, ft/min", HELD + "; one step of a rate in BDS 6,0 is 32"
    )
    constant_rate_offset_fpm: float = threshold(
        25.0, "largest distance of a managed stretch's mean rate from a multiple of 100 ft/min, ft/min", HELD
    )
    largest_bank_deg: float | None = threshold(
        None,
        "drop rows banked by more than this, degrees; off by default",
        "lift, and with it induced drag, grows by 1/cos(bank): 25 degrees add 22 % to induced drag",
    )
    cleared_speed_after_s: float | None = threshold(
        30.0,
        "drop rows under an assigned speed or Mach number, where clearances are known, and for this long after, s; "
        "none keeps them",
        "paper, section 3: flights without speed constraints; 30 kt are regained in 30 s at 1 kt/s",
    )
    cleared_speed_within_kt: float = threshold(
        10.0,
        "an assigned speed that is never flown to within this is no constraint (`or less`, `or greater`), kt",
        "ICAO Doc 4444, 4.6.1.4: speeds are instructed in steps of 10 kt; a SCAT flight descends at 260 kt under 280",
    )
    cleared_level_within_ft: float | None = threshold(
        None,
        "drop rows this near to the level that is cleared, where clearances are known, ft; off by default",
        "paper, section 3: flights without level constraints; autopilots take the rate off over the last 500 ft or so "
        "(0.05 g from 2,000 ft/min), which the transients beside level flight hold already",
    )
    climb_back_ft: float = threshold(
        1000.0,
        "climb that parts two descents of a flight (go-around), of which the larger is kept, ft",
        "a missed approach climbs by thousands of feet, a step of an encoder by 100",
    )
    longest_gap_s: float = threshold(
        60.0, "longest gap between reports that is bridged, s", "twice the slowest source's interval (30 s snapshots)"
    )
    highest_gap_ft: float = threshold(
        3000.0, "highest gap between reports that is bridged, ft", "60 s at 3,000 ft/min: the fastest clean descents"
    )
    hidden_gap_s: float = threshold(
        10.0,
        "gap in which no level-off can hide: over a longer one the mean rate must be that of a descent, s",
        "leaving a descent, levelling off and entering it again takes longer",
    )
    fewest_levels: int = threshold(
        20, "shortest descent kept, in flight levels", "2,000 ft: a minute of descent, above what a spike can feign"
    )


def describe(name: str) -> tuple[str, str]:
    """Meaning and source of a threshold."""
    meta = {field.name: field.metadata for field in dataclasses.fields(Cleaning)}[name]
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
    kinds = int if whole else (int, float)
    if isinstance(value, kinds) and not isinstance(value, bool) and 0 <= value < 1e9:
        return int(value) if whole else float(value)
    raise ConfigError(
        f"{origin}: {field.name} is {value!r}",
        expected=f"a {'whole ' if whole else ''}number of zero or more ({field.metadata['meaning']})",
        mend=f"the default is {field.default}",
    )


def read_cleaning(path: Path) -> dict[str, Any]:
    """Settings of a YAML file, not yet checked.

    Raises:
        ConfigError: If the file cannot be read or is no mapping of names to values.
    """
    yaml: Any = import_module("yaml")

    try:
        found = yaml.safe_load(path.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError, yaml.YAMLError) as error:
        reason = " ".join(str(error).split())
        raise ConfigError(f"{path}: {reason}", expected="a YAML file of thresholds", mend="correct it") from error
    if not isinstance(found, dict | None):
        raise ConfigError(
            f"{path} holds a {type(found).__name__}",
            expected="lines of `name: value`",
            mend="begin from configs/prepare/default.yaml",
        )
    return found or {}


def as_yaml(cleaning: Cleaning) -> str:
    """The thresholds as YAML, each with its meaning and source as a comment."""
    lines = ["# Thresholds of `descentflow prepare --config`; an option of the same name goes before a line here."]
    for field in dataclasses.fields(Cleaning):
        value = getattr(cleaning, field.name)
        text = f"{field.metadata['meaning']}. Source: {field.metadata['source']}."
        lines += ["", *(f"# {line}" for line in textwrap.wrap(text[0].upper() + text[1:], 110))]
        lines.append(f"{field.name}: {'null' if value is None else value}")
    return "\n".join(lines) + "\n"
