"""TensorBoard's page of custom scalars: each score in one chart with its noise floor."""

import re
from typing import Any

from descentflow.evaluation.metrics.score_registry import rows
from descentflow.evaluation.metrics.score_table import ScoreTable


def score_charts(stage: str, table: ScoreTable) -> dict[str, Any]:
    """A layout for TensorBoard's ``add_custom_scalars``: a chart for each score that has a noise floor.

    Args:
        stage: ``val`` or ``test``, with which the names of the scalars begin.
        table: The scores that are logged.

    Example:
        >>> from descentflow.evaluation.metrics.score_table import Score
        >>> floor = Score("cas_below_transition", "wasserstein", "kt", equal_size=2.6, floor=2.4)
        >>> score_charts("val", ScoreTable((floor,)))["val: scores beside noise floors"]
        {'CAS below, Wasserstein (kt)': ['Multiline', ['^val/score/cas_below_transition/wasserstein_equal_size$', ...]]}
    """
    labels = {(part.name, one.name): f"{part.short}, {one.short}" for part, one in rows(costly=True)}
    charts = {}
    for row in table:
        if row.equal_size == row.equal_size and row.floor == row.floor:
            name = f"{stage}/score/{row.quantity}/{row.statistic}"
            # TensorBoard takes them for regular expressions.
            both = [f"^{re.escape(f'{name}_{kind}')}$" for kind in ("equal_size", "floor")]
            label = labels.get((row.quantity, row.statistic), name)
            charts[f"{label} ({row.unit})"] = ["Multiline", both]
    return {f"{stage}: scores beside noise floors": charts}
