"""Limits by which a simulator is accepted: published ones by name, or a user's own in YAML."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal, get_args

from descentflow.core.arguments import Within, checked_arguments
from descentflow.core.errors import ConfigError, DescentflowError
from descentflow.core.user_files import read_settings

Quantity = Literal["airspeed", "rate", "time_ahead", "altitude_ahead", "along_track_ahead", "top_of_descent"]
UNITS: dict[str, tuple[str, str]] = {
    "airspeed": ("calibrated airspeed", "kt"),
    "rate": ("rate of descent at the flight's own airspeed", "ft/min"),
    "time_ahead": ("time to the level that is predicted for then", "s"),
    "altitude_ahead": ("altitude", "ft"),
    "along_track_ahead": ("distance along the track", "NM"),
    "top_of_descent": ("place of the top of descent", "NM"),
}
"""Quantity -> its name for readers and the unit of its limits."""
AHEAD = ("time_ahead", "altitude_ahead", "along_track_ahead")
"""Quantities of a prediction, which need a time for which it is made."""
Positive = Annotated[float, Within(1e-9)]
FlightLevel = Annotated[float, Within(0, 660)]
Minutes = Annotated[float, Within(0.5, 60)]


@dataclass(frozen=True)
class Limit:
    """Limit on one quantity.

    Attributes:
        quantity: One of :data:`UNITS`.
        absolute: Its size, in the quantity's unit; None where the quantity is measured and not judged.
        relative: The same as a share of the simulator's own value; of both the wider one holds.
        levels: Lowest and highest flight level at which it holds; all if None.
        minutes: Time for which a prediction is made.
        source: Where it comes from.

    Example:
        >>> Limit("rate", 200.0, 0.05).width(2000.0), Limit("rate", 200.0, 0.05).width(5000.0)
        (200.0, 250.0)
    """

    quantity: Quantity
    absolute: float | None = None
    relative: float | None = None
    levels: tuple[float, float] | None = None
    minutes: float | None = None
    source: str = ""

    def width(self, simulator: float) -> float | None:
        """Size of the limit at a value of the simulator; None where it judges nothing."""
        sizes = [self.absolute, None if self.relative is None else self.relative * abs(simulator)]
        known = [size for size in sizes if size is not None]
        return max(known) if known else None

    def holds_at(self, low_fl: float, high_fl: float) -> bool:
        """Test for a band that lies within its levels."""
        return self.levels is None or (self.levels[0] <= low_fl and high_fl <= self.levels[1])


@dataclass(frozen=True)
class Limits:
    """Limits with their name and source.

    Example:
        >>> part60 = read_limits("part60")
        >>> part60.name, [limit.quantity for limit in part60.limits]
        ('part60', ['airspeed', 'rate'])
    """

    name: str
    source: str
    limits: tuple[Limit, ...]

    def limit_on(self, quantity: str, levels: tuple[float, float], minutes: float | None) -> Limit | None:
        """The limit that holds there; the first of several."""
        own = (one for one in self.limits if (one.quantity, one.minutes) == (quantity, minutes))
        return next((one for one in own if one.holds_at(*levels)), None)

    @property
    def minutes(self) -> list[float]:
        """Times for which predictions are judged or measured, in order."""
        return sorted({limit.minutes for limit in self.limits if limit.minutes is not None})


def read_limits(name: str | Path) -> Limits:
    """Read limits.

    Args:
        name: ``part60`` (14 CFR Part 60, Table A2A, 1.d.4) or ``look_ahead``; or a YAML file of the same form.

    Raises:
        ConfigError: If there is no such file, or its content is not that of limits.

    Example:
        >>> _ = Path("ours.yaml").write_text('''
        ... source: our acceptance test 7
        ... limits:
        ...   - {quantity: rate, absolute: 150, levels: [100, 240]}
        ... ''')
        >>> read_limits("ours.yaml").limits[0].levels
        (100.0, 240.0)
    """
    path = _file_of(name)
    content = read_settings(path)
    if set(content) - {"source", "limits"} or not isinstance(content.get("limits"), list) or not content["limits"]:
        raise ConfigError(
            f"{path.name} with {', '.join(map(str, content)) or 'nothing'}",
            expected="`source` and a list of `limits`",
            mend="see the how-to page",
        )
    source = str(content.get("source", "")) or path.name
    return Limits(path.stem, source, tuple(_limit(path.name, row, source) for row in content["limits"]))


def _file_of(name: str | Path) -> Path:
    """A file of the user's own, or one of those that come along."""
    published = {path.stem: path for path in sorted((Path(__file__).parent / "published").glob("*.yaml"))}
    path = Path(name)
    if path.is_file():
        return path
    if str(name) in published:
        return published[str(name)]
    raise ConfigError(f"no limits {name}", expected=f"{', '.join(published)}, or a YAML file", mend="check the name")


def _limit(file: str, row: Any, source: str) -> Limit:
    """One limit of a file, checked."""
    if not isinstance(row, Mapping) or row.get("quantity") not in get_args(Quantity):
        raise ConfigError(
            f"{file}: {row}", expected=f"a `quantity` that is one of {', '.join(UNITS)}", mend="correct the line"
        )
    try:
        return _checked(**{"source": source, **row})
    except TypeError as error:
        names = "quantity, absolute, relative, levels, minutes, source"
        raise ConfigError(f"{file}: {row} ({error})", expected=names, mend="correct the line") from error
    except DescentflowError as error:
        raise ConfigError(f"{file}: {error.got}", expected=error.expected, mend="correct the line") from error


@checked_arguments
def _checked(
    quantity: Quantity,
    absolute: Positive | None = None,
    relative: Positive | None = None,
    levels: Sequence[FlightLevel] | None = None,
    minutes: Minutes | None = None,
    source: str = "",
) -> Limit:
    by_level, timed = quantity in ("airspeed", "rate"), "without" if quantity in AHEAD else "with"
    ends = (float(levels[0]), float(levels[1])) if levels and len(levels) == 2 else None
    ordered = levels is None or (by_level and ends is not None and ends[0] < ends[1])
    for is_fine, got, expected in (
        ((quantity in AHEAD) == (minutes is not None), f"{quantity} {timed} minutes", f"them for {', '.join(AHEAD)}"),
        (relative is None or by_level, f"a relative limit on {quantity}", "an absolute one"),
        (ordered, f"levels {levels} of {quantity}", "the lower and the higher level, of airspeed or rate"),
    ):
        if not is_fine:
            raise ConfigError(got, expected=expected, mend="correct the line")
    size = None if absolute is None else float(absolute)
    return Limit(quantity, size, relative, ends, minutes, source)
