"""What sampling returns: plausible descents and the account of every draw behind them."""

from dataclasses import dataclass
from typing import Any

from torch import Tensor

from descentflow.representation.decoder.trajectories import Trajectories


@dataclass(frozen=True)
class RejectionReport:
    """What became of every draw.

    A draw that breaks several rules counts under each of them, so ``broken`` may sum to more than ``rejected``.
    ``surplus`` draws were plausible but beyond the number asked for.

    Example:
        >>> report = RejectionReport(drawn=110, accepted=100, rejected=8, surplus=2, broken={"not_finite": 8})
        >>> print(report)
        100 samples from 110 draws (92.7% plausible; broken: not_finite 8)
    """

    drawn: int
    accepted: int
    rejected: int
    surplus: int
    broken: dict[str, int]

    @property
    def acceptance(self) -> float:
        """Share of draws that were plausible."""
        return (self.accepted + self.surplus) / self.drawn if self.drawn else float("nan")

    def as_dict(self) -> dict[str, Any]:
        """Primitives for a JSON report."""
        return {**self.__dict__, "acceptance": self.acceptance}

    def __str__(self) -> str:
        """One line for a terminal."""
        reasons = ", ".join(f"{rule} {count}" for rule, count in self.broken.items() if count) or "none"
        return f"{self.accepted} samples from {self.drawn} draws ({self.acceptance:.1%} plausible; broken: {reasons})"


@dataclass(frozen=True)
class Samples:
    """Accepted descents: weights (n, d), trajectories, and the account of all draws."""

    weights: Tensor
    trajectories: Trajectories
    report: RejectionReport
