"""Request of one call: speeds at levels, a time or a distance at a level, each exact or within a band."""

from collections.abc import Mapping
from dataclasses import dataclass
from math import inf, isfinite
from typing import Annotated

from torch import Tensor

from descentflow.core.errors import ConfigError
from descentflow.core.units import FL_M, KT_MPS, NM_M
from descentflow.densities.mixture_parameters import NO_CONTEXT
from descentflow.physics.airspeed import cas_to_mach, mach_to_cas_mps
from descentflow.representation.profiles import Profiles

Band = Annotated[
    float | tuple[float | None, float | None],
    "a number, or a pair of the least and the greatest, None for an open side",
]
"""A value, or the least and the greatest allowed; None leaves a side open."""
BySpeed = Band | Mapping[float, Band]
"""A speed at the level meant by default, or speeds by flight level."""
SPEEDS = ("cas_kt", "mach")
KINDS = {
    "cas_kt": ("a number of knots", "cas_kt=280 or cas_kt=(275, 285)"),
    "mach": ("a Mach number up to 1.5", "mach=0.78 or mach=(0.76, 0.78)"),
    "time_s": ("a number of seconds", "time_s=420 or time_s=(400, 450)"),
    "distance_nm": ("a number of NM", "distance_nm=44 or distance_nm=(42, 46)"),
    "level": ("a flight level", "level=200 or level=(190, 210)"),
}
"""Kind of value of each name, and examples."""


@dataclass(frozen=True)
class SpeedAsked:
    """A speed at one level of the grid, as CAS in m/s: pressure alone turns a Mach number at a level into one.

    ``level`` is an index of the grid, or -1 for the level of entry. ``name`` is ``cas_kt`` or ``mach``.

    Example:
        >>> SpeedAsked("cas_kt", 50, 275.0, 285.0).text(200.0)
        'cas_kt 275 to 285 at FL200'
    """

    name: str
    level: int
    low: float
    high: float

    def cas_mps(self, level_fl: float) -> tuple[float, float]:
        """The band as CAS in m/s at a flight level."""
        low = to_cas_mps(self.name, self.low, level_fl)
        return low, low if self.high == self.low else to_cas_mps(self.name, self.high, level_fl)

    def text(self, level_fl: float) -> str:
        """In words."""
        return f"{self.name} {band_text((self.low, self.high))} at FL{level_fl:g}"


@dataclass(frozen=True)
class PointAsked:
    """A time (s) or a distance through still air (NM), since entry, at a level or within a band of levels.

    ``levels`` are flight levels; the lower is the higher's equal unless a band was asked for.

    Example:
        >>> PointAsked("time_s", 420.0, 480.0, (200.0, 200.0)).text
        'time_s 420 to 480 at FL200'
    """

    name: str
    low: float
    high: float
    levels: tuple[float, float]

    @property
    def text(self) -> str:
        """In words."""
        return f"{self.name} {band_text((self.low, self.high))} at FL{band_text(self.levels)}"

    @property
    def unit(self) -> float:
        """SI units in one of the name's: seconds, or metres in a nautical mile."""
        return NM_M if self.name == "distance_nm" else 1.0


Constraint = SpeedAsked | PointAsked
"""One of a request."""


@dataclass(frozen=True)
class DescentRequest:
    """One call's constraints.

    Attributes:
        entry: Index of the level of entry; -1, the top of the grid, where it is drawn as the training flights entered.
        speeds: At levels.
        points: A time or a distance at a level, or none.
        key: Of the context, (1, c) in ``context``; empty without one.
        context: What the density is given.
        flown: Levels flown so far; its lowest is where the descent goes on.
        deviation_k: Temperature that the context gives, in which distances are flown.

    Example:
        >>> DescentRequest(50, (SpeedAsked("cas_kt", 20, 280.0, 280.0),)).words([150.0 + k for k in range(201)])
        ('entry at FL200', 'cas_kt 280 at FL170')
    """

    entry: int = -1
    speeds: tuple[SpeedAsked, ...] = ()
    points: tuple[PointAsked, ...] = ()
    key: tuple[tuple[str, str], ...] = ()
    context: Tensor = NO_CONTEXT
    flown: Profiles | None = None
    deviation_k: float = 0.0

    @property
    def is_free(self) -> bool:
        """True where nothing but entry and context is asked."""
        return not self.speeds and not self.points and not self.goes_on

    @property
    def goes_on(self) -> bool:
        """True where a part was flown."""
        return self.flown is not None

    def words(self, levels_fl: list[float]) -> tuple[str, ...]:
        """Each constraint in words."""
        begin = "flown to" if self.goes_on else "entry at"
        words = [f"{begin} FL{levels_fl[self.entry]:g}"] if self.entry >= 0 else []
        words += [f"{name} {value}" for name, value in self.key]
        for speed in self.speeds:
            level = self.entry if speed.level < 0 else speed.level
            text = speed.text(levels_fl[level]) if level >= 0 else speed.text(0.0).replace("FL0", "the level of entry")
            words.append(text)
        return (*words, *(point.text for point in self.points))

    def check(self, levels_fl: list[float]) -> None:
        """Refuse levels that the descent does not pass.

        Raises:
            ConfigError: If a level lies above the entry or beyond the grid, or a time has no entry to count from.
        """
        if self.points and self.entry < 0:
            raise ConfigError(
                f"{self.points[0].text}, and no level of entry",
                expected="entry_fl, from where time and distance count",
                mend="give entry_fl, or what was flown so far",
            )
        top = self.entry % len(levels_fl)
        what = "the top of the grid" if self.entry < 0 else "where the descent begins"
        for speed in self.speeds:
            if speed.level > top or (self.goes_on and speed.level == top):
                raise ConfigError(
                    speed.text(levels_fl[speed.level]),
                    expected=f"a level below {what}, FL{levels_fl[top]:g}",
                    mend="ask for the speed at a level that is still to be flown",
                )
        for point in self.points:
            if not levels_fl[0] <= point.levels[0] <= point.levels[1] < levels_fl[top]:
                raise ConfigError(
                    point.text,
                    expected=f"levels from FL{levels_fl[0]:g} to below {what}, FL{levels_fl[top]:g}",
                    mend="choose a level that the descent passes",
                )


def to_cas_mps(name: str, value: float, level_fl: float) -> float:
    """A speed as CAS in m/s.

    Example:
        >>> round(to_cas_mps("mach", 0.78, 350.0) / KT_MPS)  # kt
        264
    """
    if not isfinite(value):
        return value
    return value * KT_MPS if name == "cas_kt" else float(mach_to_cas_mps(value, level_fl * FL_M))


def of_cas_mps(name: str, cas_mps: float, level_fl: float) -> float:
    """CAS in m/s as the speed of that name, the inverse of :func:`to_cas_mps`.

    Example:
        >>> round(of_cas_mps("mach", to_cas_mps("mach", 0.78, 350.0), 350.0), 6)
        0.78
    """
    return cas_mps / KT_MPS if name == "cas_kt" else float(cas_to_mach(cas_mps, level_fl * FL_M))


def band_text(band: tuple[float, float]) -> str:
    """A band in words.

    Example:
        >>> band_text((250.0, 250.0)), band_text((-inf, 250.0))
        ('250', 'at most 250')
    """
    low, high = band
    if low == high:
        return f"{low:g}"
    if low == -inf:
        return f"at most {high:g}"
    return f"at least {low:g}" if high == inf else f"{low:g} to {high:g}"


def speeds_asked(name: str, asked: BySpeed | None, default: int, levels_fl: "list[float]") -> list[SpeedAsked]:
    """Speeds at levels of the grid.

    Args:
        name: ``cas_kt`` or ``mach``.
        asked: What the caller gave; None for nothing.
        default: Level of a speed that was given without one: an index of the grid, or -1 for that of entry.
        levels_fl: Levels of the grid, ascending.

    Raises:
        ConfigError: If a value is no speed or a level is beyond the grid.

    Example:
        >>> speeds_asked("cas_kt", {200: (None, 290)}, 0, [199.0, 200.0])
        [SpeedAsked(name='cas_kt', level=1, low=-inf, high=290.0)]
    """
    if asked is None:
        return []
    if not isinstance(asked, Mapping):
        return [SpeedAsked(name, default, *_band(name, asked))]
    speeds: list[SpeedAsked] = []
    for level, band in asked.items():
        if not levels_fl[0] <= level <= levels_fl[-1]:
            raise ConfigError(
                f"{name} at level {level!r}",
                expected=f"flight levels from {levels_fl[0]:g} to {levels_fl[-1]:g}",
                mend="choose a level of the model's grid",
            )
        nearest = min(range(len(levels_fl)), key=lambda k: abs(levels_fl[k] - level))
        if any(speed.level == nearest for speed in speeds):
            raise ConfigError(
                f"{name} twice at FL{levels_fl[nearest]:g}, the nearest to level {level:g}",
                expected="each level of the model's grid once",
                mend="leave one of them out, or ask for a band",
            )
        speeds.append(SpeedAsked(name, nearest, *_band(name, band)))
    return speeds


def points_asked(time_s: Band | None, distance_nm: Band | None, level: Band | None) -> tuple[PointAsked, ...]:
    """The time or the distance at a level that was asked for; empty if none was.

    Raises:
        ConfigError: If one part of it was given without the other, both a time and a distance, or two bands.

    Example:
        >>> points_asked(420, None, 200)
        (PointAsked(name='time_s', low=420.0, high=420.0, levels=(200.0, 200.0)),)
    """
    parts = {"time_s": time_s, "distance_nm": distance_nm, "level": level}
    given = {name: band for name, band in parts.items() if band is not None}
    if not given:
        return ()
    if len(given) != 2 or "level" not in given:
        raise ConfigError(
            " and ".join(given) + (" alone" if len(given) == 1 else ""),
            expected="a level, and either time_s or distance_nm at it",
            mend="leave one of them out"
            if len(given) > 1
            else "give both, or for a speed at a level cas_kt={level: value}",
        )
    name = next(iter(given))
    (low, high), levels = _band(name, given[name]), _band("level", given["level"])
    if high <= 0 or (low < high and levels[0] < levels[1]) or not all(isfinite(end) for end in levels):
        raise ConfigError(
            f"{name} {band_text((low, high))} at level {band_text(levels)}",
            expected="a positive value or band of it at a level, or a positive value within a band of levels",
            mend="let one of the two be a value",
        )
    return (PointAsked(name, low, high, levels),)


def _band(name: str, asked: Band) -> tuple[float, float]:
    least, greatest = (asked, asked) if isinstance(asked, int | float) else asked
    low, high = -inf if least is None else float(least), inf if greatest is None else float(greatest)
    (kind, examples), most = KINDS[name], 1.5 if name == "mach" else inf
    if low > high or (low, high) == (-inf, inf) or (name in SPEEDS and high <= 0) or max(low, 0) > most:
        raise ConfigError(
            f"{name} {asked!r:.80}",
            expected=f"{kind}, or a pair of the least and the greatest, None for an open side",
            mend=f"put the least first, {name}=({high:g}, {low:g})" if low > high else f"write for instance {examples}",
        )
    return low, high
