"""Predicted descents and what was flown, as a picture: what `descentflow predict-descent --figure` draws."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from descentflow.core.errors import DataError
from descentflow.core.units import FPM_MPS, KT_MPS
from descentflow.generation.prediction.predictor import Continuations
from descentflow.generation.sample_figures import CAS, RATE, curves_of, draw_bands
from descentflow.reporting.figure_style import BLACK, BLUE, legend_below, panels
from descentflow.representation.profiles import Profiles

MOST_FLIGHTS = 4
"""Flights that are drawn, a row of panels each: as many as a page holds."""
LINES = 12
"""Continuations that are drawn: the bands are narrow, and more would hide them."""


def prediction_figure(
    predictions: Sequence[Continuations], observed: Profiles, from_fl: float, *, seed: int = 0, lines: int = LINES
) -> Figure:
    """CAS, vertical rate and time against flight level: the predicted rest as bands, and what was flown.

    The part that was observed is drawn solid; what was flown after it, which the prediction did not see, dash-dotted.
    The first four flights are drawn, and the title has their number.

    Args:
        predictions: Continuations of flights, at least one.
        observed: The flights, also below ``from_fl``.
        from_fl: Last level that counted as observed.
        seed: Of the continuations that are drawn as lines.
        lines: How many are.

    Raises:
        DataError: If there is no prediction.

    Example:
        >>> from descentflow.generation.prediction.predict import predict
        >>> ahead = predict("best.ckpt", "descents.parquet", from_fl=290, n=60)
        >>> figure = prediction_figure(ahead.flights, ahead.observed, ahead.from_fl)
        >>> len(figure.axes), figure.axes[-3].get_xlabel()
        (12, 'CAS (kt)')
    """
    if not predictions:
        raise DataError("no prediction to draw", expected="at least one", mend="predict other flights")
    shown = predictions[:MOST_FLIGHTS]
    figure, axes = panels(10.5, 1.2 + 3.4 * len(shown), len(shown), 3, sharey=True, sharex="col")
    for row, ahead in zip(axes, shown, strict=True):
        flight = observed.subset([observed.flight_ids.index(ahead.flight_id)])
        _draw_flight(row, ahead, flight, seed, lines)
    for ax, name in zip(axes[-1], (CAS, RATE, "Time since the last observed level (min)"), strict=True):
        ax.set_xlabel(name)
    levels = shown[0].trajectories.levels_fl
    axes[0, 0].set_ylim(float(levels[0]), float(levels[-1]))
    legend_below(figure, axes.flat, 3)
    of = f" (the first {len(shown)} of {len(predictions)} flights)" if len(shown) < len(predictions) else ""
    figure.suptitle(f"Predicted from FL{from_fl:.0f}{of}", fontsize=12, fontweight="bold")
    return figure


def _draw_flight(row: np.ndarray, ahead: Continuations, flight: Profiles, seed: int, lines: int) -> None:
    levels = ahead.trajectories.levels_fl.cpu().double().numpy()
    curves = curves_of(ahead.trajectories)
    panels = (curves[CAS], curves[RATE], curves["time_s"] / 60)
    start = int(ahead.trajectories.entry[0])
    seen = flight.mask[0].cpu().numpy()
    since = flight.time_s[0] - flight.time_s[0, start]
    flown = (flight.cas_mps[0] / KT_MPS, flight.rate_mps[0] / FPM_MPS, since / 60)
    for ax, values, own in zip(row, panels, flown, strict=True):
        draw_bands(ax, levels, values, seed=seed, lines=lines)
        line = np.where(seen, own.cpu().double().numpy(), np.nan)
        _draw_line(ax, line[start:], levels[start:], "observed", color=BLACK, linestyle="-")
        _draw_line(ax, line[: start + 1], levels[: start + 1], "flown, not used", color=BLUE, linestyle="-.")
        ax.axhline(levels[start], color=BLACK, linewidth=0.6, linestyle=(0, (1, 3)))
    row[0].set_ylabel("Flight level")
    row[0].set_title(ahead.flight_id, fontsize=9, loc="left")


def _draw_line(ax: Axes, values: np.ndarray, levels: np.ndarray, label: str, **style: Any) -> None:
    if np.isfinite(values).any():
        ax.plot(values, levels, linewidth=1.8, label=label, **style)
