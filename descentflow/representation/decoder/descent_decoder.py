"""The decoder: latent weights to drag and CAS profiles to trajectories, with all that it needs as buffers."""

from typing import Any

import torch
from torch import Tensor, nn

from descentflow.aircraft_types.registry import aircraft_from_state
from descentflow.core.units import FL_M
from descentflow.physics.performance_model import PerformanceModel
from descentflow.representation.decoder.flight_grid import FlightGrid, flight_grid
from descentflow.representation.decoder.trajectories import Trajectories, integrate
from descentflow.representation.drag_scale import DragScale
from descentflow.representation.fpca.basis import FunctionalBasis
from descentflow.representation.profiles import Profiles
from descentflow.representation.residuals import Residuals


class DescentDecoder(nn.Module):
    """Map standardised weights to descents, and descents to standardised weights.

    A weight vector holds the weights of drag first, then those of CAS (paper, section 2.3), each minus its mean and
    divided by its standard deviation over the training flights.

    Example:
        >>> from descentflow.densities.checkpoint import load_model
        >>> model = load_model("best.ckpt")
        >>> decoder = model.representation.decoder
        >>> flown = decoder(model.sample(100, seed=0), entry=torch.full((100,), 150))
        >>> flown.time_s[:, 0].shape  # seconds from entry to the lowest level
        torch.Size([100])
    """

    levels_fl: Tensor
    weight_mean: Tensor
    weight_scale: Tensor
    drag_basis: FunctionalBasis
    cas_basis: FunctionalBasis
    residuals: Residuals

    def __init__(
        self,
        aircraft: PerformanceModel,
        levels_fl: Tensor,
        drag_basis: FunctionalBasis,
        cas_basis: FunctionalBasis,
        drag_scale: DragScale,
        weight_mean: Tensor,
        weight_scale: Tensor,
        mass_kg: float | None = None,
        residuals: Residuals | None = None,
    ) -> None:
        """Build from fitted parts.

        Args:
            aircraft: Coefficients of the type that flies.
            levels_fl: (L,) ascending flight levels of the bases.
            drag_basis: Basis of drag (N), on its scale.
            cas_basis: Basis of CAS (m/s).
            drag_scale: On which profiles of drag are linear in the weights.
            weight_mean: (d,) mean of the training flights' weights.
            weight_scale: (d,) their standard deviation.
            mass_kg: Mass that inferred the drag and flies it; the reference mass if absent.
            residuals: What samples have beyond the components; nothing if absent.
        """
        super().__init__()
        self.aircraft = aircraft if mass_kg is None else aircraft.at_mass(mass_kg)
        self.drag_basis, self.cas_basis = drag_basis, cas_basis
        self.register_buffer("levels_fl", levels_fl.to(torch.float64), persistent=False)
        self.register_buffer("weight_mean", weight_mean.to(torch.float64), persistent=False)
        self.register_buffer("weight_scale", weight_scale.to(torch.float64), persistent=False)
        self.drag_scale = drag_scale
        self.residuals = Residuals.none(len(levels_fl), self.dimension) if residuals is None else residuals
        self._grids: dict[tuple[torch.dtype, torch.device], tuple[PerformanceModel, FlightGrid]] = {}

    def grid(self, like: Tensor) -> FlightGrid:
        """Tables for flying the own levels, at the own mass and no temperature deviation.

        Computed once for each precision and device, and again should ``aircraft`` be another one, or have numbers with
        gradients.

        Args:
            like: A tensor of the precision and on the device wanted.
        """
        key = (like.dtype, like.device)
        aircraft, grid = self._grids.get(key, (None, None))
        if grid is None or aircraft is not self.aircraft:
            grid = flight_grid(self.aircraft, (self.levels_fl * FL_M).to(like))
            if grid.is_plain:
                self._grids[key] = (self.aircraft, grid)
        return grid

    @property
    def dimension(self) -> int:
        """Number of weights d."""
        return sum(basis.n_components for basis in self.bases.values())

    @property
    def bases(self) -> dict[str, FunctionalBasis]:
        """Basis of each profile by its name, in the order of the weights."""
        return {"drag": self.drag_basis, "CAS": self.cas_basis}

    @property
    def sizes(self) -> str:
        """Number of weights of each profile, for a line of text: ``3 of drag, 1 of CAS``."""
        return ", ".join(f"{basis.n_components} of {name}" for name, basis in self.bases.items())

    @property
    def transition_fl(self) -> float:
        """Flight level where nominal BADA hands over from Mach to CAS; infinite where the type has no Mach leg."""
        return float(self.aircraft.transition_altitude_m()) / FL_M

    def encode(self, profiles: Profiles) -> Tensor:
        """Standardised weights (n, d) of observed profiles on this decoder's grid, gaps allowed."""
        observed = self.drag_scale.observed(profiles)
        parts = zip(self.bases.values(), observed.values, strict=True)
        raw = torch.cat([basis.encode(values, observed.mask) for basis, values in parts], 1)
        standardised: Tensor = (raw - self.weight_mean) / self.weight_scale
        return standardised

    def curves(self, weights: Tensor, residual: Tensor | None = None) -> tuple[Tensor, Tensor]:
        """Drag (n, L) in N and CAS (n, L) in m/s of standardised weights (n, d) (paper, equation 4).

        Args:
            weights: (n, d).
            residual: (n, r + s) residual numbers, see :class:`~descentflow.representation.residuals.Residuals`.
        """
        drag, cas_mps = self.scaled_profiles(weights, residual)
        return self.drag_scale.drag_n(drag, cas_mps), cas_mps

    def scaled_profiles(self, weights: Tensor, residual: Tensor | None = None) -> tuple[Tensor, Tensor]:
        """Profiles (n, L) in the order of :attr:`bases`, linear in weights (n, d) and residual numbers (n, r + s).

        Drag is on the scale on which it is linear (:class:`~descentflow.representation.drag_scale.DragScale`).
        """
        raw = weights * self.weight_scale.to(weights) + self.weight_mean.to(weights)
        n_drag = self.drag_basis.n_components
        drag, cas = self.drag_basis.decode(raw[:, :n_drag]), self.cas_basis.decode(raw[:, n_drag:])
        if residual is not None:
            drag, cas = self.residuals.added(drag, cas, residual.to(weights))
        return drag, cas

    def fly_scaled(self, profiles: tuple[Tensor, ...], entry: Tensor, out: Trajectories | None = None) -> Trajectories:
        """Fly profiles (n, L) as :meth:`scaled_profiles` gives them, at the own mass in standard air."""
        drag, cas_mps = profiles
        drag_n = self.drag_scale.drag_n(drag, cas_mps)
        grid = self.grid(drag_n)
        return integrate(self.aircraft, self.levels_fl, grid.altitude_m, drag_n, cas_mps, entry, out=out, grid=grid)

    def forward(
        self,
        weights: Tensor,
        entry: Tensor | None = None,
        *,
        out: Trajectories | None = None,
        residual: Tensor | None = None,
    ) -> Trajectories:
        """Fly weights (n, d) from their entry levels at the own mass in standard air, in the weights' precision.

        Other air is that of :func:`descentflow.representation.own_air.flown_in`; other masses and coefficients are
        arguments of :func:`descentflow.representation.decoder.trajectories.integrate`.

        Args:
            weights: (n, d) standardised weights.
            entry: (n,) index of the entry level; the top of the grid if absent.
            out: Descents of the same shape whose arrays may take the result.
            residual: (n, r + s) residual numbers; without them the components fly alone.
        """
        if entry is None:
            entry = torch.full((len(weights),), len(self.levels_fl) - 1, device=weights.device)
        return self.fly_scaled(self.scaled_profiles(weights, residual), entry, out)

    def to_state(self) -> dict[str, Any]:
        """Tensors and primitives from which :meth:`from_state` rebuilds the decoder."""
        return {
            "aircraft": self.aircraft.to_state(),
            "levels_fl": self.levels_fl.cpu(),
            "drag_basis": self.drag_basis.to_state(),
            "cas_basis": self.cas_basis.to_state(),
            "drag_scale": self.drag_scale.to_state(),
            "weight_mean": self.weight_mean.cpu(),
            "weight_scale": self.weight_scale.cpu(),
            "residuals": self.residuals.to_state(),
        }

    @classmethod
    def from_state(cls, state: dict[str, Any]) -> "DescentDecoder":
        """Rebuild from :meth:`to_state`."""
        return cls(
            aircraft_from_state(state["aircraft"]),
            state["levels_fl"],
            FunctionalBasis.from_state(state["drag_basis"]),
            FunctionalBasis.from_state(state["cas_basis"]),
            DragScale.from_state(state["drag_scale"]),
            state["weight_mean"],
            state["weight_scale"],
            residuals=Residuals.from_state(state["residuals"]),
        )
