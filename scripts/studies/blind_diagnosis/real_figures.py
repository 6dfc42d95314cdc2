"""Figures of real flights with a channel withheld."""

import polars as pl
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from descentflow.core.units import FT_M, KT_MPS
from descentflow.reporting.figure_style import BLACK, BLUE, GREY, RED, tidy
from studies.blind_diagnosis.real_flights import TemperatureCheck, WindCheck, found

PER_KFT = 1000 * FT_M / KT_MPS
"""From 1/s to kt in 1,000 ft."""


def real_figure(temperature: TemperatureCheck, wind: WindCheck | None) -> Figure:
    """Air temperature by the diagnosis and by heights that it never saw; wind by the diagnosis and by other aircraft.

    Args:
        temperature: Flights near Bengaluru.
        wind: Dutch flights, if at hand.

    Returns:
        A figure of two panels, or of one.

    Example:
        >>> from studies.blind_diagnosis.real_flights import check_temperature
        >>> check = check_temperature(lambda descents, typecode, channels: {"causes": []})
        >>> len(real_figure(check, None).axes)
        1
    """
    figure = Figure(figsize=(11.0 if wind else 6.0, 5.2), layout="constrained")
    panels = figure.subplots(1, 2 if wind else 1, squeeze=False).ravel()
    _temperature(panels[0], temperature)
    if wind is not None:
        _wind(panels[1], wind)
    tidy(panels)
    return figure


def _temperature(ax: Axes, check: TemperatureCheck) -> None:
    """One line per flight by heights, over the levels that it spans."""
    for low, high, deviation in check.by_height.by_flight.select("low_fl", "high_fl", "deviation_k").iter_rows():
        ax.plot([deviation] * 2, [low, high], color=GREY, linewidth=1.2, label="one flight, by its heights")
    mean, error = check.by_height.mean_k, check.by_height.error_k
    ax.axvspan(mean - 2 * error, mean + 2 * error, color="#dddddd", zorder=0)
    ax.axvline(mean, color=BLACK, linestyle="--", linewidth=1.4, label=f"all flights, by heights: {mean:.1f} K")
    estimate = found(check.with_channel, "temperature", "deviation_k")
    if estimate is not None:
        ax.axvspan(estimate["low"], estimate["high"], color="#bcd7ea", zorder=1)
        text = f"diagnosed with TAS: {estimate['estimate']:.1f} K"
        ax.axvline(estimate["estimate"], color=BLUE, linewidth=1.6, label=text)
    ax.axvline(0.0, color=RED, linewidth=0.8, linestyle=":", label="standard air, as simulated")
    ax.set_xlabel("deviation from the standard temperature, K")
    ax.set_ylabel("flight level")
    ax.set_title("Arrivals near Bengaluru", fontsize=10)
    _legend(ax)


def _wind(ax: Axes, check: WindCheck) -> None:
    """Gradient along the track of every flight by the wind of others, and what was diagnosed."""
    table = check.by_others.by_flight.join(
        check.descents.frame.group_by("flight_id").agg(
            pl.col("level_fl").min().alias("low"), pl.col("level_fl").max().alias("high")
        ),
        on="flight_id",
    )
    for low, high, slope in table.select("low", "high", "slope_per_s").iter_rows():
        ax.plot([PER_KFT * slope] * 2, [low, high], color=GREY, linewidth=1.2, label="one flight, by others' wind")
    mean, error = PER_KFT * check.by_others.mean_per_s, PER_KFT * check.by_others.error_per_s
    ax.axvspan(mean - 2 * error, mean + 2 * error, color="#dddddd", zorder=0)
    text = f"all flights, by others' wind: {mean:+.2f} kt / 1,000 ft"
    ax.axvline(mean, color=BLACK, linestyle="--", linewidth=1.4, label=text)
    estimate = found(check.with_channel, "wind_gradient", "slope_per_s")
    if estimate is None:
        ax.plot([], [], color=BLUE, label="diagnosed with groundspeed: no wind gradient named")
    else:
        low, middle, high = (PER_KFT * estimate[key] for key in ("low", "estimate", "high"))
        ax.axvspan(low, high, color="#bcd7ea", zorder=1)
        ax.axvline(middle, color=BLUE, linewidth=1.6, label=f"diagnosed with groundspeed: {middle:+.2f} kt / 1,000 ft")
    ax.set_xlabel("growth of the tailwind with altitude, kt / 1,000 ft")
    ax.set_title("Arrivals over the Netherlands", fontsize=10)
    _legend(ax)


def _legend(ax: Axes) -> None:
    """Each name once, below the panel."""
    named = dict(zip(*reversed(ax.get_legend_handles_labels()), strict=True))
    ax.legend(
        named.values(),
        named.keys(),
        frameon=False,
        fontsize=8,
        loc="upper center",
        bbox_to_anchor=(0.5, -0.14),
        ncols=2,
    )
