"""Figures of samples and flights show the numbers that they are said to show, or a reason for none."""

from collections.abc import Callable
from functools import cache

import numpy as np
import pytest
import torch
import toys
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from descentflow.core.units import KT_MPS
from descentflow.evaluation.figures._score_figures import acceptance_figure, level_scores_figure
from descentflow.evaluation.figures.level_cuts import cuts_figure
from descentflow.evaluation.figures.profile_bands import profiles_figure
from descentflow.evaluation.metrics.descent_set import DescentSet
from descentflow.evaluation.metrics.scores import score
from descentflow.generation.samples import RejectionReport
from descentflow.physics.nominal_descent import nominal_descent


@cache
def flights(n: int, seed: int = 0) -> DescentSet:
    return DescentSet.of_profiles(toys.flights(n, seed))


@cache
def nominal() -> DescentSet:
    return DescentSet.of_nominal(nominal_descent(toys.AIRCRAFT, flights(40).levels_fl))


def drawn(figure: Figure) -> Figure:
    """Drawing must not warn either (warnings are errors)."""
    FigureCanvasAgg(figure).draw()
    return figure


def line(ax: Axes, label: str) -> Line2D:
    (labelled,) = (x for x in ax.lines if x.get_label() == label)
    return labelled


def test_profiles_show_each_set_with_its_mean() -> None:
    real, samples = flights(40), flights(60, 1)
    figure = drawn(profiles_figure(real, {"a": samples, "b": real}, nominal(), n_lines=10, title="TOY"))
    axes = np.reshape(figure.axes, (3, 3))
    cas = torch.where(samples.mask, samples.cas_mps, torch.nan).nanmean(0) / KT_MPS
    np.testing.assert_allclose(line(axes[1, 1], "mean of samples").get_xdata(), cas, rtol=1e-12)
    assert [len(ax.lines) for ax in axes[0]] == [12, 13, 13]  # ten descents, nominal, mean of flights, own mean
    assert "mean of samples" not in [x.get_label() for x in axes[0, 0].lines]
    np.testing.assert_allclose(
        line(axes[0, 2], "mean of samples").get_xdata(), line(axes[0, 2], "mean of held out").get_xdata(), rtol=1e-12
    )


def test_distances_are_those_of_the_scores() -> None:
    samples, real = flights(60, 1), flights(50)
    table = score(samples, real, 290.0, seed=3, n_splits=4)
    figure = drawn(level_scores_figure(table, 290.0))
    levels = {(x.quantity, x.statistic): x for x in table.levels}
    shown = line(figure.axes[3], "samples against flights").get_xdata()
    np.testing.assert_array_equal(shown, levels["rocd", "wasserstein"].equal_size)
    assert line(figure.axes[0], "transition").get_ydata()[0] == 290


def test_densities_and_distribution_functions() -> None:
    real = flights(60)
    figure = drawn(cuts_figure(real, {"a": flights(80, 1)}, nominal(), 290.4, title="TOY"))
    axes = np.reshape(figure.axes, (2, 3))
    for ax in axes[0]:
        for name in ("held out", "a"):
            x, y = (np.asarray(v) for v in line(ax, name).get_data())
            assert np.trapezoid(y, x) == pytest.approx(1, abs=2e-3)  # the tails beyond four bandwidths hold 1e-4
    steps = line(axes[1, 1], "held out")
    there = real.mask[:, 140]
    np.testing.assert_allclose(steps.get_xdata()[1:], (real.cas_mps[there, 140] / KT_MPS).sort().values, rtol=1e-12)
    assert axes[1, 1].get_xlabel() == "CAS at FL290 (kt)"
    assert line(axes[1, 1], "nominal BADA").get_xdata()[0] == pytest.approx(float(nominal().cas_mps[0, 140]) / KT_MPS)


def test_acceptance_accounts_for_every_draw() -> None:
    report = RejectionReport(200, 100, 60, 40, {"not_finite": 0, "cas_below_bound": 50, "drag_below_bound": 30})
    figure = drawn(acceptance_figure(report))
    assert sum(patch.get_width() for patch in figure.axes[0].patches) == pytest.approx(100)
    assert [patch.get_width() for patch in figure.axes[1].patches] == [0, 25, 15]
    assert "70.0% plausible" in figure.get_suptitle()


def few_descents(n: int) -> DescentSet:
    levels, shape = torch.arange(150.0, 156.0), (n, 6)
    return DescentSet(
        levels,
        torch.arange(6.0).flip(0).expand(shape).double() * 4,
        torch.full(shape, 150.0).double(),
        torch.full(shape, -9.0).double(),
        torch.full(shape, 4e4).double(),
        torch.ones(shape, dtype=torch.bool),
    )


NOTHING: dict[str, Callable[[], Figure]] = {
    "distances by level of two flights": lambda: level_scores_figure(
        score(few_descents(2), few_descents(2), 290.0), 290.0
    ),
    "cuts of two flights": lambda: cuts_figure(
        few_descents(2), {"flow": few_descents(2)}, few_descents(2).subset(torch.arange(0)), 152.0
    ),
    "no rule broken": lambda: acceptance_figure(RejectionReport(drawn=5, accepted=5, rejected=0, surplus=0, broken={})),
    "nothing drawn": lambda: acceptance_figure(RejectionReport(drawn=0, accepted=0, rejected=0, surplus=0, broken={})),
}


@pytest.mark.parametrize("name", NOTHING)
def test_every_panel_says_why_it_is_empty(name: str) -> None:
    figure = NOTHING[name]()
    figure.draw_without_rendering()
    panels = [ax for ax in figure.axes if ax.get_visible()]
    # Acceptance has a bar of what became of the draws above its rules.
    said = [ax for ax in panels if any(len(text.get_text()) > 12 for text in ax.texts)]
    drawn = [ax for ax in panels if ax.patches]
    assert panels
    assert {id(ax) for ax in panels} == {id(ax) for ax in (*said, *drawn)}
    assert said
