"""The masses that inferred the drag of a model's training flights, as a checkpoint keeps them."""

from dataclasses import dataclass
from typing import Any

from torch import Tensor

from descentflow.air.kept_air import MOST
from descentflow.core.errors import CheckpointError


@dataclass(frozen=True)
class KeptMass:
    """The column that gave each flight's mass, and the masses that samples are drawn with.

    Attributes:
        column: Its name, in which other flights' masses are looked for.
        training_kg: (m,) masses of the training flights.

    Example:
        >>> kept = KeptMass("mass_kg", torch.tensor([60e3, 70e3]).double())
        >>> KeptMass.from_state(kept.to_state()).training_kg
        tensor([60000., 70000.], dtype=torch.float64)
    """

    column: str
    training_kg: Tensor

    def to_state(self) -> dict[str, Any]:
        """Tensors and primitives for a checkpoint: of as many flights as have their air kept, and of the same ones."""
        some = self.training_kg[:: max(-(-len(self.training_kg) // MOST), 1)]
        return {"column": self.column, "training_kg": some.float()}

    @classmethod
    def from_state(cls, state: dict[str, Any]) -> "KeptMass":
        """Rebuild from :meth:`to_state`.

        Raises:
            CheckpointError: If it is not what :meth:`to_state` gives.
        """
        column, masses = state.get("column"), state.get("training_kg")
        whole = isinstance(masses, Tensor) and masses.dim() == 1 and len(masses) > 0 and bool((masses > 0).all())
        if not isinstance(column, str) or not isinstance(masses, Tensor) or not whole:
            raise CheckpointError(
                f"the masses of column {column!r}",
                expected="positive masses of training flights, kg",
                mend="take the file as `descentflow fit` wrote it, or fit again",
            )
        return cls(column, masses.double())

    def describe(self) -> str:
        """One line: where they come from, and what they were."""
        masses = self.training_kg
        return f"of each flight, by {self.column}: {masses.mean():,.0f} kg ({masses.min():,.0f} to {masses.max():,.0f})"
