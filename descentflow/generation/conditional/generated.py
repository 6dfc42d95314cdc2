"""Result of a generator: samples, the request that they meet, and the effective proposals behind each."""

from dataclasses import dataclass, field

import numpy as np

from descentflow.generation.samples import Samples


@dataclass(frozen=True, repr=False)
class GeneratedSamples(Samples):
    """n descents that meet what was asked; all that :class:`~descentflow.generation.samples.Samples` does.

    Attributes:
        asked: What they meet, in words, with the level of every speed.
        first: Number of the first; the others follow.
        effective: (n,) effective proposals that each was chosen among, 1 for all where they are drawn in closed form.
        proposals: Proposals that each was chosen among, at least; 1 in closed form.

    Example:
        >>> import descentflow as df
        >>> one = df.Generator("best.ckpt", seed=1).next(entry_fl=330, cas_kt=(275, 285))
        >>> one.asked, one.proposals
        (('entry at FL330', 'cas_kt 275 to 285 at FL234'), 1)
    """

    asked: tuple[str, ...] = ()
    first: int = 0
    effective: np.ndarray = field(default_factory=lambda: np.ones(0))
    proposals: int = 1

    def __str__(self) -> str:
        """The samples, what was asked, and the effective proposals."""
        lines = [super().__str__(), "asked: " + ("; ".join(self.asked) or "nothing")]
        if self.proposals > 1:
            least, middle = float(self.effective.min()), float(np.median(self.effective))
            lines.append(
                f"each chosen among {self.proposals} proposals or more, {middle:.0f} of them effective (median; "
                f"{least:.0f} at least)"
            )
        return "\n".join(lines)

    def __repr__(self) -> str:
        """As printed."""
        return str(self)
