"""Request of one call, checked against the model's grid, and put in words."""

from dataclasses import dataclass

from torch import Tensor

from descentflow.core.errors import ConfigError
from descentflow.generation.conditional.constraints import PointAsked, SpeedAsked
from descentflow.representation.profiles import Profiles


@dataclass(frozen=True)
class Request:
    """One call's constraints.

    Attributes:
        entry: Index of the level of entry; None where it is drawn as the training flights entered.
        speeds: At levels.
        point: A time or a distance at a level.
        key: Of the context, (1, c) in ``context``; empty without one.
        context: What the density is given.
        flown: Levels flown so far; its lowest is where the descent goes on.
        deviation_k: Temperature that the context gives, in which distances are flown.

    Example:
        >>> Request(50, (SpeedAsked("cas_kt", 20, 280.0, 280.0),)).words([150.0 + k for k in range(201)])
        ('entry at FL200', 'cas_kt 280 at FL170')
    """

    entry: int | None = None
    speeds: tuple[SpeedAsked, ...] = ()
    point: PointAsked | None = None
    key: tuple[tuple[str, str], ...] = ()
    context: Tensor | None = None
    flown: Profiles | None = None
    deviation_k: float = 0.0

    @property
    def is_free(self) -> bool:
        """True where nothing but entry and context is asked."""
        return not self.speeds and self.point is None and self.flown is None

    def words(self, levels_fl: list[float]) -> tuple[str, ...]:
        """Each constraint in words."""
        begin = "flown to" if self.flown is not None else "entry at"
        words = [] if self.entry is None else [f"{begin} FL{levels_fl[self.entry]:g}"]
        words += [f"{name} {value}" for name, value in self.key]
        for speed in self.speeds:
            if speed.level >= 0 or self.entry is not None:
                words.append(speed.text(levels_fl[self.entry if speed.level < 0 else speed.level]))  # type: ignore[index]
            else:
                words.append(speed.text(0.0).replace("FL0", "the level of entry"))
        return (*words, self.point.text) if self.point is not None else tuple(words)

    def check(self, levels_fl: list[float]) -> None:
        """Refuse levels that the descent does not pass.

        Raises:
            ConfigError: If a level lies above the entry or beyond the grid, or a time has no entry to count from.
        """
        if self.point is not None and self.entry is None:
            raise ConfigError(
                f"{self.point.text}, and no level of entry",
                expected="entry_fl, from where time and distance count",
                mend="give entry_fl, or what was flown so far",
            )
        top = len(levels_fl) - 1 if self.entry is None else self.entry
        what = "the top of the grid" if self.entry is None else "where the descent begins"
        for speed in self.speeds:
            if speed.level > top or (self.flown is not None and speed.level == top):
                raise ConfigError(
                    speed.text(levels_fl[speed.level]),
                    expected=f"a level below {what}, FL{levels_fl[top]:g}",
                    mend="ask for the speed at a level that is still to be flown",
                )
        if self.point is not None and not levels_fl[0] <= self.point.levels[0] <= self.point.levels[1] < levels_fl[top]:
            raise ConfigError(
                self.point.text,
                expected=f"levels from FL{levels_fl[0]:g} to below {what}, FL{levels_fl[top]:g}",
                mend="choose a level that the descent passes",
            )
