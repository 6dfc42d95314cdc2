"""The functional bases of drag and CAS: mean function, components and what they explain."""

from collections.abc import Callable

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from torch import Tensor

from descentflow.core.units import KT_MPS
from descentflow.reporting.figure_style import BLACK, BLUE, RED, legend_below, panels
from descentflow.representation.drag_scale import DragScale
from descentflow.representation.fpca.basis import FunctionalBasis

MAX_COMPONENTS = 4
"""Components drawn of each basis; the bars show all."""


def components_figure(
    drag_basis: FunctionalBasis,
    cas_basis: FunctionalBasis,
    levels_fl: Tensor,
    drag_scale: DragScale,
) -> Figure:
    """Mean function plus and minus each component, and the shares of variance explained.

    Components are drawn two standard deviations of their weight to either side. The paper's mode-by-mode basis does not
    know these: there, the components have an arbitrary scale that keeps only their relative size.

    Args:
        drag_basis: Basis of drag.
        cas_basis: Basis of CAS on the same levels.
        levels_fl: (L,) ascending grid.
        drag_scale: On which the basis of drag is linear.

    Returns:
        A figure of two or three rows (drag, Mach, CAS): a panel for each component up to four, then the shares.

    Example:
        >>> from descentflow.densities.checkpoint import load_model
        >>> decoder = load_model("best.ckpt").representation.decoder
        >>> scale = decoder.drag_scale
        >>> figure = components_figure(decoder.drag_basis, decoder.cas_basis, decoder.levels_fl, scale)
        >>> figure.axes[0].get_xlabel()
        'Drag (kN)'
    """
    levels_fl = levels_fl.detach().cpu()

    def kilonewtons(values: Tensor) -> Tensor:
        return drag_scale.drag_n(values, drag_scale.cas_mps) / 1000

    bases = ("Drag (kN)", kilonewtons, drag_basis), ("CAS (kt)", _knots, cas_basis)
    n_panels = min(MAX_COMPONENTS, max(basis.n_components for _, _, basis in bases))
    figure, axes = panels(2.6 * n_panels + 3.4, 3.5 * len(bases), len(bases), n_panels + 1)
    for row, (name, shown, basis) in zip(axes, bases, strict=True):
        for k, ax in enumerate(row[:-1]):
            if k < basis.n_components:
                _draw_component(ax, basis, k, levels_fl, shown)
                ax.set_xlabel(name)
            else:
                ax.set_axis_off()
        row[0].set_ylabel("Flight level")
        _draw_shares(row[-1], basis)
    legend_below(figure, axes[:, :-1].flat)
    return figure


def weight_deviations(basis: FunctionalBasis) -> Tensor | None:
    """Standard deviation (k,) of each weight under the basis' probabilistic PCA; None where it has none.

    Example:
        >>> from descentflow.densities.checkpoint import load_model
        >>> basis = load_model("best.ckpt").representation.decoder.cas_basis
        >>> deviations = weight_deviations(basis)
        >>> len(deviations) == basis.n_components, bool((deviations > 0).all())
        (True, True)
    """
    if basis.loadings.shape[1] == 0:
        return None
    # The variance of phi' x dh, where x has covariance loadings loadings' + noise I and phi' phi dh = 1.
    projected = basis.components @ basis.loadings * basis.spacing_m
    return (projected.square().sum(1) + basis.noise_variance * basis.spacing_m).sqrt()


def _knots(values: Tensor) -> Tensor:
    return values / KT_MPS


def _draw_component(
    ax: Axes, basis: FunctionalBasis, k: int, levels_fl: Tensor, shown: Callable[[Tensor], Tensor]
) -> None:
    mean = basis.mean.detach().cpu()
    change, name = _change(basis, k)
    change = change.detach().cpu()
    ax.plot(shown(mean + change), levels_fl, color=RED, linestyle="--", linewidth=1.6, label=f"mean + {name}")
    ax.plot(shown(mean - change), levels_fl, color=BLUE, linestyle="-.", linewidth=1.6, label=f"mean - {name}")
    ax.plot(shown(mean), levels_fl, color=BLACK, linewidth=1.6, label="mean")
    ax.set_title(f"component {k + 1} ({float(basis.explained_variance[k]):.0%})", fontsize=10)
    ax.set_ylim(float(levels_fl[0]), float(levels_fl[-1]))


def _change(basis: FunctionalBasis, k: int) -> tuple[Tensor, str]:
    """Curves added to and taken from the mean, and their names."""
    deviations = weight_deviations(basis)
    component = basis.components[k]
    if deviations is not None:
        return 2 * deviations[k] * component, "two s.d. of the weight"
    shape = component / component.square().mean().sqrt()
    relative = (basis.explained_variance[k] / basis.explained_variance[0]).sqrt()
    return 0.1 * basis.mean.abs().mean() * relative * shape, "component (arbitrary scale)"


def _draw_shares(ax: Axes, basis: FunctionalBasis) -> None:
    shares = 100 * basis.explained_variance.detach().cpu().numpy()
    positions = np.arange(1, len(shares) + 1)
    ax.bar(positions, shares, color=BLUE, label="each")
    ax.plot(positions, shares.cumsum(), color=RED, marker="o", label="together")
    ax.set_ylim(0, 100)
    ax.set_xlim(0, max(len(shares), 3) + 1)
    ax.set_xticks(positions[:: max(len(shares) // 8, 1)])
    ax.set_xlabel("Component")
    ax.set_ylabel("Variance explained (%)")
    ax.legend(loc="lower center", bbox_to_anchor=(0.5, 1), ncols=2, frameon=False, fontsize=9)
