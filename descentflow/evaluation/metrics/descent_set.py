"""Set of descents on one grid, real or sampled, to be compared."""

from dataclasses import dataclass, fields, replace

import torch
from torch import Tensor

from descentflow.core.errors import DataError
from descentflow.physics.nominal_descent import NominalDescent
from descentflow.representation.decoder.trajectories import Trajectories, burn_of
from descentflow.representation.profiles import Profiles


@dataclass(frozen=True, eq=False)
class DescentSet:
    """n descents on L ascending levels; masked values are never read.

    Shapes: ``levels_fl`` (L,), all else (n, L). ``time_s`` grows downwards and may be measured from each flight's own
    first level: only differences within a flight are used. ``drag_n`` is drawn by figures and not scored.

    Raises:
        DataError: If shapes do not agree or levels do not ascend.

    Example:
        >>> from descentflow.generation.sample import sample
        >>> samples = DescentSet.of_trajectories(sample("best.ckpt", 50, entry_fl=300).trajectories)
        >>> len(samples), len(samples.time_to_bottom_s())  # none spans the grid, which ends higher
        (50, 0)
    """

    levels_fl: Tensor
    time_s: Tensor
    cas_mps: Tensor
    rate_mps: Tensor
    drag_n: Tensor
    mask: Tensor
    fuel_flow_kg_s: Tensor | None = None
    """NaN where it is not known; None where it is known of no descent."""

    def __post_init__(self) -> None:
        shape = (len(self.mask), len(self.levels_fl))
        wrong = [name for name, values in self._per_flight().items() if values.shape != shape]
        if wrong or self.mask.dtype != torch.bool:
            raise DataError(
                f"a set of descents whose {', '.join(wrong) or 'mask'} is not {'(n, L)' if wrong else 'bool'}",
                expected=f"tensors of shape {shape} and a mask of bool",
                mend="build the set from one Profiles or Trajectories",
            )
        if not bool((self.levels_fl.diff() > 0).all()):
            raise DataError(
                "levels that do not ascend", expected="flight levels from low to high", mend="sort the levels"
            )

    def __len__(self) -> int:
        """Number of descents."""
        return len(self.mask)

    def subset(self, index: Tensor) -> "DescentSet":
        """The descents at these positions, or where a bool mask (n,) is true."""
        return replace(self, **{name: values[index] for name, values in self._per_flight().items()})

    def spans_grid(self) -> Tensor:
        """(n,) true for descents observed at every level.

        A gap would hide a level-off that was cut out of the flight; its time would count, and a free descent never
        spends it.
        """
        return self.mask.all(1)

    def time_to_bottom_s(self) -> Tensor:
        """Seconds from the highest to the lowest level, of the descents that span the grid (paper, section 4.3)."""
        whole = self.time_s[self.spans_grid()]
        return whole[:, 0] - whole[:, -1]

    def _per_flight(self) -> dict[str, Tensor]:
        named = {f.name: getattr(self, f.name) for f in fields(self) if f.name != "levels_fl"}
        return {name: values for name, values in named.items() if values is not None}

    @classmethod
    def of_profiles(cls, real: Profiles) -> "DescentSet":
        """Real descents."""
        values = real.time_s, real.cas_mps, real.rate_mps, real.drag_n, real.mask, real.fuel_flow_kg_s
        return cls(real.levels_fl, *values)

    @classmethod
    def of_trajectories(cls, flown: Trajectories, *, fuel: bool = False) -> "DescentSet":
        """Sampled descents, in float64 on the CPU; with their fuel flow where it is asked for and known."""
        burnt = burn_of(flown) if fuel else None
        flow = None if burnt is None else burnt.flow_kg_s.detach().double().cpu()
        time_s, cas, rate, drag = (
            values.detach().double().cpu() for values in (flown.time_s, flown.cas_mps, flown.rate_mps, flown.drag_n)
        )
        return cls(flown.levels_fl.double().cpu(), time_s, cas, rate, drag, flown.mask.cpu(), flow)

    @classmethod
    def of_nominal(cls, nominal: NominalDescent) -> "DescentSet":
        """The one nominal BADA descent, on every level."""
        time_s, cas, rate, drag, fuel = (
            values.detach().double().cpu().reshape(1, -1)
            for values in (nominal.time_s, nominal.cas_mps, nominal.rate_mps, nominal.drag_n, nominal.fuel_kg_s)
        )
        levels_fl = nominal.level_fl.double().cpu()
        return cls(levels_fl, time_s, cas, rate, drag, torch.ones_like(time_s, dtype=torch.bool), fuel)
