"""The sampler and its decoder as modules that can be traced: numbers in, descents in the units of the tables out."""

from collections.abc import Callable, Iterable, Mapping
from typing import Any, Literal

import torch
from torch import Tensor, nn
from torch.overrides import TorchFunctionMode

from descentflow.core.errors import ConfigError
from descentflow.core.units import NM_M
from descentflow.densities.density import Density
from descentflow.densities.weight_draws import MixtureDraw
from descentflow.generation.sample_columns import FUEL
from descentflow.generation.sample_tables import flown_quantities
from descentflow.representation.decoder.trajectories import Trajectories, through_air_m
from descentflow.representation.own_air import check_standard_air
from descentflow.representation.plausibility import RULES, Plausibility
from descentflow.representation.representation import Representation

Precision = Literal["float64", "float32"]
PRECISIONS: dict[str, torch.dtype] = {"float64": torch.float64, "float32": torch.float32}
"""Of inputs and outputs; the decoder's own arithmetic is float64 in both."""
OFF_GRID = "entry_off_grid"
ALL_RULES = (*RULES, OFF_GRID)
"""Reasons to reject a draw: the sampler's own rules, and an entry level that the model does not have."""
PROFILES = ("time_s", "CAS", "Mach", "TAS", "vertical_rate", "drag_n", *FUEL, "distance_nm")
"""Outputs (n, L) with the names and units of the tables of samples."""


class ExactConstants(TorchFunctionMode):
    """Inside the block, a Python number that float32 would round takes part in torch's functions as a tensor.

    Example:
        >>> with ExactConstants():
        ...     scaled = torch.ones(2, dtype=torch.float64) * 0.1
        >>> scaled
        tensor([0.1000, 0.1000], dtype=torch.float64)
    """

    def __torch_function__(
        self,
        func: Callable[..., Any],
        types: Iterable[type],
        args: tuple[Any, ...] = (),
        kwargs: Mapping[str, Any] | None = None,
    ) -> Any:
        """Call the function with such numbers among its positional arguments replaced."""
        if func is torch.full and isinstance(args[1], float):
            return torch.tensor(args[1], **(kwargs or {})).expand(args[0])
        if any(isinstance(arg, torch.Tensor) for arg in args):
            args = tuple(_tensor(arg) if _is_rounded(arg) else arg for arg in args)
        return func(*args, **(kwargs or {}))


def _is_rounded(value: object) -> bool:
    return isinstance(value, float) and value == value and float(torch.tensor(value, dtype=torch.float32)) != value


def _tensor(value: float) -> torch.Tensor:
    return torch.tensor(value, dtype=torch.float64)


class DescentGraph(nn.Module):
    """Weights in, descents out, with whether each is plausible.

    Example:
        >>> from descentflow.densities.checkpoint import load_model
        >>> model = load_model("best.ckpt")
        >>> graph = DescentGraph(model.representation, "float32")
        >>> out = graph(model.sample(3, seed=0).float(), torch.full((3,), 330.0))
        >>> out["time_s"].dtype, out["accepted"].shape, bool(out["time_s"][:, -1].isnan().all())  # above FL330
        (torch.float32, torch.Size([3]), True)
    """

    def __init__(self, representation: Representation, precision: Precision = "float64") -> None:
        """Take decoder and bounds of a model.

        Raises:
            ConfigError: If the decoder cannot be exported.
        """
        super().__init__()
        check_standard_air(representation, "an exported program")
        self.dtype = PRECISIONS[precision]
        self.decoder = representation.decoder
        if representation.correction is not None:
            raise ConfigError(
                "a corrected model, whose effects are drawn flight by flight",
                expected="a model without a correction",
                mend="export the model that was corrected, or samples of this one (--to parquet)",
            )
        self.decoder.grid(self.decoder.levels_fl)  # made before anything is traced
        self.plausibility = Plausibility.from_state(representation.plausibility.to_state())

    def entry(self, entry_fl: Tensor) -> Tensor:
        """Indices (n,) of the levels nearest to flight levels (n,)."""
        return (entry_fl.double()[:, None] - self.decoder.levels_fl).abs().argmin(1)

    def forward(self, weights: Tensor, entry_fl: Tensor, neighbour: Tensor | None = None) -> dict[str, Tensor]:
        """Fly weights (n, d) from flight levels (n,).

        Uniform numbers (n,) pick the training flight whose residual each takes; without, components fly alone.

        Returns:
            ``level_fl`` (L,) ascending; :data:`PROFILES` (n, L), NaN above the entry level; ``accepted`` (n,);
            ``broken`` (n, rules) which of :data:`ALL_RULES` each breaks.
        """
        with ExactConstants():
            return self._outputs(self._flown(weights, self.entry(entry_fl), neighbour), entry_fl)

    def _flown(self, weights: Tensor, entry: Tensor, neighbour: Tensor | None) -> Trajectories:
        """Descents of the decoder, in float64."""
        weights = weights.double()
        residual = None if neighbour is None else self.decoder.residuals.draw(weights, entry, neighbour)
        flown: Trajectories = self.decoder(weights, entry, residual=residual)
        return flown

    def _outputs(self, flown: Trajectories, entry_fl: Tensor) -> dict[str, Tensor]:
        levels_fl = self.decoder.levels_fl
        off_grid = (entry_fl.double() < levels_fl[0]) | (entry_fl.double() > levels_fl[-1]) | entry_fl.isnan()
        broken = torch.cat([self.plausibility.broken_rules(flown), off_grid[:, None]], 1)
        values = {**flown_quantities(flown), "distance_nm": through_air_m(flown) / NM_M}
        profiles = {name: torch.where(flown.mask, values[name], torch.nan).to(self.dtype) for name in PROFILES}
        return {"level_fl": levels_fl.to(self.dtype).clone(), **profiles, "accepted": ~broken.any(1), "broken": broken}


class SamplerGraph(nn.Module):
    """Standard normals in, descents out: the density, then :class:`DescentGraph`.

    Example:
        >>> from descentflow.densities.checkpoint import load_model
        >>> sampler = SamplerGraph(load_model("best.ckpt"))
        >>> inputs = sampler.example_inputs(100)
        >>> {name: tuple(value.shape) for name, value in inputs.items()}
        {'noise': (100, 4), 'entry_fl': (100,), 'neighbour': (100,)}
        >>> bool(sampler(**inputs)["accepted"].float().mean() > 0.5)
        True
    """

    def __init__(self, density: Density, precision: Precision = "float64") -> None:
        """Take a density with its representation.

        Raises:
            ConfigError: If density or decoder cannot be exported.
        """
        super().__init__()
        self.dimension, self.n_context = density.dimension, density.n_context
        mixture = density.mixture
        self.draw = density.weight_draw(PRECISIONS[precision]) if mixture is None else MixtureDraw(mixture)
        self.descents = DescentGraph(density.representation, precision)

    def forward(
        self,
        noise: Tensor,
        entry_fl: Tensor,
        neighbour: Tensor | None = None,
        uniform: Tensor | None = None,
        context: Tensor | None = None,
    ) -> dict[str, Tensor]:
        """Draw and fly n descents.

        Args:
            noise: (n, d) standard normals.
            entry_fl: (n,) flight levels where they start.
            neighbour: (n,) uniform numbers in [0, 1) that pick the training flight whose residual each takes.
            uniform: (n,) uniform numbers in [0, 1) that pick components of a mixture.
            context: (n, c) encoded contexts of a conditional density.

        Returns:
            As :class:`DescentGraph`, with the ``weights`` (n, d).
        """
        with ExactConstants():
            weights = self.draw(noise, uniform, context)
        outputs: dict[str, Tensor] = self.descents(weights, entry_fl, neighbour)
        return {**outputs, "weights": weights.to(self.descents.dtype)}

    def example_inputs(self, n: int) -> dict[str, Tensor]:
        """Inputs of :meth:`forward` for n descents that start as the training flights did (contexts are zero)."""
        generator, dtype = torch.Generator().manual_seed(0), self.descents.dtype
        bounds, levels_fl = self.descents.plausibility, self.descents.decoder.levels_fl

        def normal(width: int) -> Tensor:
            return torch.randn(n, width, generator=generator, dtype=torch.float64).to(dtype)

        inputs = {"noise": normal(self.dimension), "entry_fl": levels_fl[bounds.draw_entry(n, generator)].to(dtype)}
        if self.descents.decoder.residuals.n_numbers:
            inputs["neighbour"] = torch.rand(n, generator=generator, dtype=torch.float64).to(dtype)
        if self.draw.picks:
            inputs["uniform"] = torch.rand(n, generator=generator, dtype=torch.float64).to(dtype)
        if self.n_context:
            inputs["context"] = torch.zeros(n, self.n_context, dtype=dtype)
        return inputs
