"""The air in which a model's drag was inferred, and the training flights' own, as a checkpoint keeps them."""

from dataclasses import dataclass
from typing import Any, Literal

import torch

from descentflow.air.level_air import LevelAir
from descentflow.core.errors import CheckpointError
from descentflow.weather.weather_layout import STRONGEST_MPS

MAX_KEPT_FLIGHTS = 2000
"""Training flights whose airs are kept: 3.6 MB of 228 levels; their mean is known to a forty-fifth of their spread."""
WARMEST_K = 80.0
"""Beyond it, and beyond the strongest wind, no air is on earth: a checkpoint that holds more is not whole."""


@dataclass(frozen=True)
class KeptAir:
    """Air in which drag was inferred, flight by flight, and the airs that samples are drawn with.

    Attributes:
        source: ``measured`` by the flights' own reports, or by a weather ``field``.
        wind: Whether the wind was known; still air if not.
        training: (m, L) airs of the training flights, on the decoder's grid.
    """

    source: Literal["measured", "field"]
    wind: bool
    training: LevelAir

    def to_state(self) -> dict[str, Any]:
        """Tensors and primitives for a checkpoint, single precision; no flight is named."""
        some = self.training.rows(
            torch.arange(len(self.training))[:: max(-(-len(self.training) // MAX_KEPT_FLIGHTS), 1)]
        )
        return {
            "source": self.source,
            "wind": self.wind,
            "deviation_k": some.deviation_k.float(),
            "tailwind_mps": some.tailwind_mps.float(),
        }

    @classmethod
    def from_state(cls, state: dict[str, Any], n_levels: int) -> "KeptAir":
        """Rebuild from :meth:`to_state`."""
        deviation, tailwind = state.get("deviation_k"), state.get("tailwind_mps")
        source, wind = state.get("source"), state.get("wind")
        whole = (
            isinstance(deviation, torch.Tensor)
            and isinstance(tailwind, torch.Tensor)
            and deviation.shape == tailwind.shape == (len(deviation), n_levels)
            and len(deviation) > 0
            and bool((deviation.abs() <= WARMEST_K).all() and (tailwind.abs() <= STRONGEST_MPS).all())
        )
        if not whole or source not in ("measured", "field") or not isinstance(wind, bool):
            raise CheckpointError(
                f"the air of source {source!r}",
                expected=f"temperature deviation and wind of training flights on {n_levels} levels",
                mend="take the file as `descentflow fit` wrote it, or fit again",
            )
        assert isinstance(deviation, torch.Tensor) and isinstance(tailwind, torch.Tensor)  # noqa: PT018 - for mypy
        return cls(source, wind, LevelAir(deviation.double(), tailwind.double()))

    def describe(self) -> str:
        """One line: where it comes from, and what the training flights' air was."""
        spread = self.training.deviation_k
        low, high = float(spread.min()), float(spread.max())
        wind = "wind along the track" if self.wind else "no wind"
        return (
            f"{'as flights measured it' if self.source == 'measured' else 'of a weather field'}: temperature "
            f"ISA {float(spread.mean()):+.1f} K (from {low:+.1f} to {high:+.1f}) and {wind}"
        )
