"""Figures of the study show the numbers that they are said to show."""

import numpy as np
import polars as pl
import torch
import toys
from matplotlib.backends.backend_agg import FigureCanvasAgg

from descentflow.evaluation.metrics.descent_set import DescentSet
from descentflow.physics.nominal_descent import nominal_descent
from studies.paper.figures.boxes import box_values, boxes_figure
from studies.paper.figures.mass_range import N_MASSES, mass_range
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
