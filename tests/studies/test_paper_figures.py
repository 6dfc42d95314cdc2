"""Figures of the study show the numbers that they are said to show."""

import itertools
from dataclasses import replace

import numpy as np
import polars as pl
import pytest
import torch
import toys
from matplotlib.backends.backend_agg import FigureCanvasAgg

from descentflow.core.errors import DataError
from descentflow.evaluation.metrics.descent_set import DescentSet
from descentflow.physics.nominal_descent import nominal_descent
from studies.paper.figures.boxes import box_values, boxes_figure
from studies.paper.figures.mass_range import N_MASSES, mass_range, mass_range_figure
from studies.paper.figures.rejection_rates import rejection_rates_figure
from studies.paper.figures.sweep_curves import completed_figure, flow_sizes_figure, variance_figure
from studies.paper.study_tables import QUANTITIES

AIRCRAFT = toys.AIRCRAFT


def test_flights_that_are_badas_own_are_explained_by_mass_and_slower_ones_are_not() -> None:
    levels = torch.arange(150.0, 361.0, dtype=torch.float64)
    masses = torch.linspace(float(AIRCRAFT.mass_minimum_kg), float(AIRCRAFT.mass_maximum_kg), 12).double()
    sets = [DescentSet.of_nominal(nominal_descent(AIRCRAFT, levels, float(mass))) for mass in masses[1:-1]]
    columns = {
        name: torch.cat([getattr(one, name) for one in sets])
        for name in ("time_s", "cas_mps", "rate_mps", "drag_n", "mask")
    }
    own = DescentSet(levels, **columns)
    slower = DescentSet(levels, **{**columns, "time_s": 2 * columns["time_s"]})
    assert mass_range(own, AIRCRAFT).explained == 1
    found = mass_range(slower, AIRCRAFT)
    assert found.explained == 0
    assert found.nominal_time_s.shape == (N_MASSES, len(levels))
    assert found.range_s[0] < float(found.reference_time_s[0]) < found.range_s[1]


def test_flights_are_compared_from_the_level_that_half_of_them_reach() -> None:
    real = DescentSet.of_profiles(toys.flights(60))
    found = mass_range(real, AIRCRAFT)
    reach = real.mask[:, len(found.levels_fl) - 1].double().mean()
    assert float(reach / real.mask[:, 0].double().mean()) >= 0.5
    assert bool((found.time_s[:, -1] == 0).all())
    figure = mass_range_figure(real, AIRCRAFT, n_lines=5, title="TOY")
    FigureCanvasAgg(figure).draw()
    assert len(figure.axes[0].lines) == min(5, len(found.time_s)) + N_MASSES + 2
    nothing = real.subset(torch.zeros(len(real), dtype=torch.bool))
    with pytest.raises(DataError, match="no flight observed"):
        mass_range(nothing, AIRCRAFT)


@pytest.mark.parametrize("faster", [0.3, 1.0, 1.3, 1.9])
def test_numbers_of_the_axes_do_not_run_into_each_other(faster: float) -> None:
    real = DescentSet.of_profiles(toys.flights(60))
    figure = mass_range_figure(replace(real, rate_mps=faster * real.rate_mps), AIRCRAFT, n_lines=5)
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    for ax in figure.axes:
        left, right = ax.get_xlim()
        labels = [t for t in ax.get_xticklabels() if t.get_text() and left <= t.get_position()[0] <= right]
        boxes = sorted((t.get_window_extent(canvas.get_renderer()) for t in labels), key=lambda box: box.x0)
        assert len(boxes) >= 3
        assert all(one.x1 + 4 <= other.x0 for one, other in itertools.pairwise(boxes))


def scores() -> pl.DataFrame:
    rows = [
        (typecode, model, quantity, statistic, "1", k + (model == "b"), 0.5 * k, 9.0 if statistic == "mae" else None)
        for k, typecode in enumerate(("X", "Y", "Z"), start=1)
        for model in ("a", "b")
        for quantity in QUANTITIES
        for statistic in ("ks", "wasserstein", "mae")
    ]
    names = ["typecode", "model", "quantity", "statistic", "unit", "score", "floor", "nominal"]
    return pl.DataFrame(rows, schema=names, orient="row")


def test_boxes_hold_a_value_a_type_and_the_floor_counts_once() -> None:
    chosen = scores().filter(quantity="cas_above_transition", statistic="mae")
    found = dict(box_values(chosen, {"a": "A", "b": "B"}, with_nominal=True))
    assert found == {"A": [1, 2, 3], "B": [2, 3, 4], "floor": [0.5, 1.0, 1.5], "BADA": [9.0] * 3}
    figure = boxes_figure(scores(), {"a": "A", "b": "B"})
    FigureCanvasAgg(figure).draw()
    assert len(figure.axes) == 9
    dots = [line for line in figure.axes[0].lines if line.get_marker() == "."]
    np.testing.assert_array_equal([line.get_ydata() for line in dots], [[1, 2, 3], [2, 3, 4], [0.5, 1, 1.5]])


def test_rejection_rates_are_drawn_as_percentages_in_groups() -> None:
    figure = rejection_rates_figure({"X": {"A": 0.05, "B": 0.1}, "Y": {"A": 0.2, "B": 0.0}})
    FigureCanvasAgg(figure).draw()
    heights = [[bar.get_height() for bar in group] for group in figure.axes[0].containers]  # type: ignore[attr-defined]
    np.testing.assert_allclose(heights, [[5, 20], [10, 0]])


def test_variance_boxes_hold_a_value_a_type_and_fold() -> None:
    rows = [
        (typecode, share, fold, statistic, "1", share + fold + (side == "above"))
        for typecode in ("X", "Y")
        for share in (0.5, 0.8)
        for fold in range(3)
        for statistic in ("ks", "wasserstein", "mae")
        for side in ("above", "below")
    ]
    names = ["typecode", "share", "fold", "statistic", "unit", "score"]
    figure = variance_figure(pl.DataFrame(rows, schema=names, orient="row"))
    FigureCanvasAgg(figure).draw()
    (means,) = (line for line in figure.axes[0].lines if line.get_marker() == "x")
    np.testing.assert_allclose(means.get_ydata(), [0.5 + 1 + 0.5, 0.8 + 1 + 0.5])


def test_completed_flights_are_drawn_where_nothing_was_observed() -> None:
    values, mask = torch.arange(8.0).reshape(2, 4), torch.tensor([[1, 1, 0, 0], [1, 1, 1, 0]]).bool()
    figure = completed_figure(
        torch.arange(150.0, 154.0), {"CAS (kt)": (values, mask)}, {"CAS (kt)": {"m": values + 10}}
    )
    FigureCanvasAgg(figure).draw()
    drawn = [np.asarray(line.get_xdata(), dtype=float) for line in figure.axes[0].lines]
    np.testing.assert_array_equal(drawn[0], [np.nan, np.nan, 12, 13])
    np.testing.assert_array_equal(drawn[2], [0, 1, np.nan, np.nan])


def test_flow_sizes_show_the_mean_of_types() -> None:
    figure = flow_sizes_figure({2: {1: [0.0, 1.0], 4: [2.0, 4.0]}, 5: {1: [0.0], 4: [0.0]}})
    FigureCanvasAgg(figure).draw()
    two = next(line for line in figure.axes[0].lines if line.get_label() == "2 flows")
    np.testing.assert_allclose(two.get_ydata(), [0.5, 3.0])
