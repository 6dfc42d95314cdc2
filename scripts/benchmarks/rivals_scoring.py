"""Score of an answer: right, wrong or none, by the same rule for all methods."""

from collections.abc import Sequence
from dataclasses import dataclass
from statistics import mean, median

RIGHT, WRONG, NONE = "right", "wrong", "none"


@dataclass(frozen=True)
class Answer:
    """Answer of one method to one set.

    Attributes:
        named: What it names, strongest first; each as all effects that the name may stand for.
        gap: True if it finds a gap; None if it does not decide.
        unknown: True if it finds that the cause, or what remains, is none that it knows.
        says_causes: Whether the method can name causes at all.
    """

    named: tuple[frozenset[str], ...] = ()
    gap: bool | None = None
    unknown: bool = False
    says_causes: bool = True


@dataclass(frozen=True)
class Scored:
    """One answer beside the truth, with the seconds of one processor that it took."""

    name: str
    kind: str
    effects: frozenset[str]
    answer: Answer
    seconds: float

    @property
    def cause(self) -> str | None:
        """Right, wrong or none; None for a method that cannot name causes.

        Nothing named is right where nothing was planted. An effect that was planted must be among those that the first
        name stands for. What lies outside the catalogue must be called unknown and not by a name.
        """
        if not self.answer.says_causes:
            return None
        named = self.answer.named
        if self.kind == "null":
            return WRONG if named or self.answer.unknown else RIGHT
        if not named:
            return RIGHT if self.answer.unknown and self.kind == "outside" else NONE
        return RIGHT if named[0] & self.effects else WRONG

    @property
    def exact(self) -> bool | None:
        """True if all that was planted is named, and nothing else is."""
        if not self.answer.says_causes or self.kind in ("null", "outside"):
            return None
        named = self.answer.named
        every = all(any(effect in group for group in named) for effect in self.effects)
        return every and all(group & self.effects for group in named)


@dataclass(frozen=True)
class Tally:
    """Counts of one method over sets of a kind."""

    n: int
    right: int
    wrong: int
    none: int
    exact: int
    gaps: int
    says_gaps: int
    left_open: float
    seconds: float


def tally(scored: Sequence[Scored]) -> Tally:
    """Count; `left_open` is the mean number of effects that the first name stands for (0 where nothing is named)."""
    causes = [one.cause for one in scored]
    first = [len(one.answer.named[0]) for one in scored if one.answer.named]
    said = [one.answer.gap for one in scored if one.answer.gap is not None]
    return Tally(
        len(scored),
        causes.count(RIGHT),
        causes.count(WRONG),
        causes.count(NONE),
        sum(bool(one.exact) for one in scored),
        sum(said),
        len(said),
        mean(first) if first else 0.0,
        median(one.seconds for one in scored) if scored else 0.0,
    )
