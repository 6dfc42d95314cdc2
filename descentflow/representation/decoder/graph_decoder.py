"""The decoder as one expression of its inputs, without in-place steps or numbers read out of tensors: for export."""

from dataclasses import replace

import torch
from torch import Tensor, nn

from descentflow.core.errors import ConfigError
from descentflow.physics.fused_table import LevelTable, level_rate
from descentflow.representation.decoder.descent_decoder import DescentDecoder
from descentflow.representation.decoder.flight_grid import FlightGrid
from descentflow.representation.decoder.lower_speed import LowerSpeed, lower_of, with_crossovers
from descentflow.representation.decoder.trajectories import Trajectories
from descentflow.representation.drag_scale import DragScale

TABLE = tuple(LevelTable.__dataclass_fields__)


class GraphDecoder(nn.Module):
    """Weights to descents, as :class:`~.descent_decoder.DescentDecoder` does, to rounding.

    What is linear in the weights, drag in newtons and CAS, one product gives at the L levels and at the b sides of the
    jumps; what is not (drag on its logarithmic scale, the lower of a Mach number and a CAS) is made at the levels and
    continued to the sides, as the decoder does. The time between two levels is linear in the
    slowness at these places. All of it is in float64.

    Example:
        >>> from descentflow.densities.checkpoint import load_model
        >>> decoder, weights = (model := load_model("best.ckpt")).representation.decoder, model.sample(5, seed=0)
        >>> entry = torch.full((5,), len(decoder.levels_fl) - 1)
        >>> torch.allclose(GraphDecoder(decoder)(weights, entry).time_s, decoder(weights).time_s, rtol=0, atol=1e-9)
        True
    """

    levels_fl: Tensor
    drag_mean: Tensor
    drag_loadings: Tensor
    cas_mean: Tensor
    cas_loadings: Tensor
    at_lower: Tensor
    at_upper: Tensor
    residual: Tensor | None
    at_sides: Tensor | None
    mach_mean: Tensor
    mach_loadings: Tensor
    altitude_m: Tensor
    half_step_m: Tensor
    to_sides: Tensor | None
    thrust_n: Tensor | None
    speed_residual: Tensor | None

    def __init__(self, decoder: DescentDecoder) -> None:
        """Take a fitted decoder apart.

        Raises:
            ConfigError: If it has a correction, or coefficients that are tensors.
        """
        super().__init__()
        if decoder.correction is not None:
            raise ConfigError(
                "a corrected model, whose effects are drawn flight by flight",
                expected="a model without a correction",
                mend="export the model that was corrected, or samples of this one (--to parquet)",
            )
        grid = decoder.grid(decoder.levels_fl)
        if grid is None:
            raise ConfigError(
                "coefficients that are tensors", expected="one number each", mend="replace them by their values"
            )
        self.n_white = decoder.n_white
        self.register_buffer("levels_fl", decoder.levels_fl.clone())
        self._keep_curves(decoder, grid)
        self._keep_quadrature(grid)
        for name in TABLE:
            parts = [getattr(table, name) for table in (grid.levels, grid.sides)]
            self.register_buffer(f"table_{name}", torch.cat(parts))

    def _keep_curves(self, decoder: DescentDecoder, grid: FlightGrid) -> None:
        """Addition of one weight to drag and CAS, at the levels and then at the sides."""

        def everywhere(curves: Tensor) -> Tensor:
            return torch.cat([curves, grid.breaks.continued(curves)], -1)

        sizes = [basis.n_components for basis in decoder.bases.values()]
        means, scales = (torch.split(values, sizes) for values in (decoder.weight_mean, decoder.weight_scale))
        for (name, basis), mean, scale in zip(decoder.bases.items(), means, scales, strict=True):
            # What is not linear, the lower of Mach and CAS, is continued to the sides once it is known.
            linear = decoder.drag_scale is None if name == "drag" else decoder.speed == "cas"
            placed = everywhere if linear else torch.clone
            self.register_buffer(f"{name.lower()}_mean", placed(basis.decode(mean[None]))[0])
            self.register_buffer(f"{name.lower()}_loadings", placed(basis.components * scale[:, None]))
        # Absent and not empty where there is none: empty tensors cannot be saved with a program.
        of_drag = decoder.drag_scale
        placed = everywhere if of_drag is None else torch.clone
        self.register_buffer("residual", placed(decoder.residual) if len(decoder.residual) else None)
        self.register_buffer("thrust_n", None if of_drag is None else of_drag.thrust_n.clone())
        self.force_n = 0.0 if of_drag is None else of_drag.force_n
        extra = decoder.speed_residual
        placed = everywhere if decoder.speed == "cas" else torch.clone
        self.register_buffer("speed_residual", placed(extra) if len(extra) else None)
        self.mach_sizes = decoder.mach_basis.n_components if decoder.mach_basis is not None else 0
        if decoder.speed == "mach_cas":
            self.register_buffer("altitude_m", grid.altitude_m.clone())
            self.register_buffer("half_step_m", grid.half_step_m.clone())
        to_sides = grid.breaks.continued(torch.eye(len(decoder.levels_fl)).to(grid.altitude_m))
        self.register_buffer("to_sides", to_sides if to_sides.shape[1] else None)

    def _keep_quadrature(self, grid: FlightGrid) -> None:
        """Metres by which the slowness at the lower level, the upper level and the sides enters each cell's time."""
        breaks = grid.breaks
        lower, upper = grid.half_step_m.clone(), grid.half_step_m.clone()
        sides = lower.new_zeros(len(breaks.base), len(lower))
        for place, (cell, below, above) in enumerate(breaks.cells):
            lower[cell], upper[cell] = below, above
            sides[:, cell] = breaks.inner[:, place]
        self.register_buffer("at_lower", lower)
        self.register_buffer("at_upper", upper)
        self.register_buffer("at_sides", sides if len(sides) else None)

    def forward(self, weights: Tensor, entry: Tensor, residual_noise: Tensor | None = None) -> Trajectories:
        """Fly weights (n, d) from entry levels (n,), indices of the grid, in float64.

        Args:
            weights: (n, d) standardised weights.
            entry: (n,) indices.
            residual_noise: (n, r) standard normals for what lies beyond the components; without them there is nothing.
        """
        n_levels = len(self.levels_fl)
        double, n_drag = weights.double(), len(self.drag_loadings)
        white = None if residual_noise is None else residual_noise.double()
        n_white = 0 if self.residual is None else len(self.residual)
        drag_n = self.drag_mean + double[:, :n_drag] @ self.drag_loadings
        if white is not None and self.residual is not None:
            drag_n = drag_n + white[:, :n_white] @ self.residual
        if self.thrust_n is not None:
            drag_n = self._at_sides(DragScale(self.thrust_n, self.force_n).drag_n(drag_n))
        table = LevelTable(*(getattr(self, f"table_{name}") for name in TABLE))
        ahead_mps = None
        if self.mach_sizes:
            schedule = self._schedule(double[:, n_drag:], None if white is None else white[:, n_white:])
            cas_mps, ahead_mps = self._at_sides(schedule.cas_mps), schedule.ahead_mps
            table = replace(table, compression=(self._at_sides(ahead_mps) >= 0).double())
        else:
            cas_mps = self.cas_mean + double[:, n_drag:] @ self.cas_loadings
            if white is not None and self.speed_residual is not None:
                cas_mps = cas_mps + white[:, n_white:] @ self.speed_residual
        mach, tas_mps, rate_mps, slowness = level_rate(table, drag_n, cas_mps)
        legs = slowness[:, : n_levels - 1] * self.at_lower + slowness[:, 1:n_levels] * self.at_upper
        if self.at_sides is not None:
            legs = legs + slowness[:, n_levels:] @ self.at_sides
        if ahead_mps is not None:
            legs = with_crossovers(legs, slowness[:, :n_levels], ahead_mps, self.half_step_m)
        # Seconds gained on the way up are negative: the rate is.
        climbed = nn.functional.pad(legs.cumsum(1), (1, 0))
        time_s = climbed - climbed.gather(1, entry[:, None])
        profiles = (values[:, :n_levels] for values in (cas_mps, mach, tas_mps, rate_mps, drag_n))
        return Trajectories(self.levels_fl, entry, time_s, *profiles)

    def _schedule(self, weights: Tensor, white: Tensor | None) -> LowerSpeed:
        """The lower of Mach and CAS, of their weights and of standard normals for their deviations."""
        of_mach, of_cas = weights[:, : self.mach_sizes], weights[:, self.mach_sizes :]
        mach, cas = self.mach_mean + of_mach @ self.mach_loadings, self.cas_mean + of_cas @ self.cas_loadings
        if white is not None and self.speed_residual is not None:
            mach_extra, cas_extra = (white @ self.speed_residual).chunk(2, 1)
            mach, cas = mach + mach_extra, cas + cas_extra
        return lower_of(mach, cas, self.altitude_m)

    def _at_sides(self, values: Tensor) -> Tensor:
        """Values (n, L) of the levels, with those continued to the sides of the jumps."""
        return values if self.to_sides is None else torch.cat([values, values @ self.to_sides], 1)
