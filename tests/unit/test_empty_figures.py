"""A figure that has nothing to show gives the reason: no panel is left blank."""

from collections.abc import Callable

import pytest
import torch
from matplotlib.figure import Figure

from descentflow.evaluation.figures._score_figures import acceptance_figure, level_scores_figure
from descentflow.evaluation.figures.level_cuts import cuts_figure
from descentflow.evaluation.metrics.descent_set import DescentSet
from descentflow.evaluation.metrics.scores import score
from descentflow.generation.samples import RejectionReport


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
