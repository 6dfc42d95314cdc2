"""Empty figures in place of an evaluation's, for tests of whole runs: drawing them is a third of a run's time.

The figures themselves have tests of their own (``tests/unit/test_evaluation_figures.py``), and a run's real ones are
written in one test of the command line (``real_figures``).
"""

import pytest
from matplotlib.figure import Figure

from descentflow.evaluation.evaluation_report import Evaluation

REAL = Evaluation.figures
NAMES = ("profiles", "cuts", "distance_by_level", "rejections", "components")


def plain(found: Evaluation) -> dict[str, Figure]:
    """A figure of nothing for each name."""
    return {name: Figure(figsize=(1, 1)) for name in NAMES}


def draw_plain(patch: pytest.MonkeyPatch) -> None:
    """Let evaluations draw nothing."""
    patch.setattr(Evaluation, "figures", plain)
