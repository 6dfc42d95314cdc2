"""Effects of which only ratios can be observed: together they may be scaled without a trace."""

from dataclasses import dataclass


@dataclass(frozen=True)
class ScaleGroup:
    """Names of effects that scale one equation together, and their description for readers.

    Attributes:
        members: Names of the effects.
        why: Why no flight can tell them apart, and what would.

    Example:
        >>> from descentflow.effects import EFFECTS
        >>> EFFECTS["mass"].scale_group.members
        ('mass', 'idle_thrust', 'drag_polar')
    """

    members: tuple[str, ...]
    why: str


THRUST_DRAG_WEIGHT = ScaleGroup(
    ("mass", "idle_thrust", "drag_polar"),
    "all scaled together they leave no trace; a weighed aircraft or a measured thrust would decide",
)
"""The energy equation holds (thrust minus drag) over weight: a common factor of the three cancels (BADA 3, 3.2)."""
