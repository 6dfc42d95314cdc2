"""Descents over BADA's whole range of mass, next to those flown (paper, figure 1)."""

from dataclasses import dataclass

import torch
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator
from torch import Tensor

from descentflow.core.errors import DataError
from descentflow.core.units import FPM_MPS, KT_MPS
from descentflow.evaluation.metrics.descent_set import DescentSet
from descentflow.physics.nominal_descent import nominal_descent
from descentflow.physics.performance_model import PerformanceModel
from descentflow.reporting.figure_style import BAND, BLACK, BLUE, GREY, legend_below, panels

N_MASSES = 9
"""From the smallest to the largest mass, both among them."""
MIN_FLIGHTS = 10
"""Flights below which no percentile is drawn."""
_BROWN = "#d9b38c"


@dataclass(frozen=True, eq=False)
class MassRange:
    """Flights from a common level to the bottom, and BADA's descents at all masses over the same levels.

    Shapes: ``levels_fl`` (L,); ``time_s`` (n, L), zero at the common level, of flights observed on all L levels;
    ``nominal_time_s`` (N_MASSES, L); ``reference_time_s`` (L,).

    Example:
        >>> time, nominal = torch.tensor([[700.0, 0.0], [990.0, 0.0]]), torch.tensor([[600.0, 0.0], [800.0, 0.0]])
        >>> found = MassRange(torch.tensor([150.0, 350.0]), time, nominal, nominal[0])
        >>> found.range_s, found.explained
        ((600.0, 800.0), 0.5)
    """

    levels_fl: Tensor
    time_s: Tensor
    nominal_time_s: Tensor
    reference_time_s: Tensor

    @property
    def range_s(self) -> tuple[float, float]:
        """Shortest and longest of BADA's times to the bottom over all masses."""
        times = self.nominal_time_s[:, 0]
        return float(times.min()), float(times.max())

    @property
    def explained(self) -> float:
        """Share of the flights whose time to the bottom some mass gives."""
        low, high = self.range_s
        times = self.time_s[:, 0]
        return float(((times >= low) & (times <= high)).double().mean())


def mass_range(flights: DescentSet, aircraft: PerformanceModel, reached_by: float = 0.5) -> MassRange:
    """Compare flights with BADA's descents at all masses, from the level that a share of them reach.

    Args:
        flights: Flights on a grid.
        aircraft: Coefficients of their type.
        reached_by: Share of the flights that define the common level.

    Raises:
        DataError: If no flight is observed on every level below the common one.

    Example:
        >>> from descentflow.aircraft_types.open_types.open_aircraft import open_aircraft
        >>> from descentflow.representation.profiles import profiles_from_frame
        >>> from descentflow.surveillance.descents.prepared_descents import read_descents
        >>> aircraft = open_aircraft("A320")
        >>> profiles = profiles_from_frame(read_descents("descents.parquet").frame, aircraft, 150)
        >>> flights = DescentSet.of_profiles(profiles)
        >>> 0 < mass_range(flights, aircraft).explained < 1
        True
    """
    reached = flights.mask.double().mean(0) >= reached_by * flights.mask[:, 0].double().mean()
    start = max(int(reached.nonzero().max()) if bool(reached.any()) else 0, 1)
    levels = flights.levels_fl[: start + 1]
    whole = flights.mask[:, : start + 1].all(1)
    if not bool(whole.any()):
        raise DataError(
            f"no flight observed on every level up to FL{float(levels[-1]):.0f}",
            expected="at least one",
            mend="give more flights, or a larger reached_by",
        )
    time = flights.time_s[whole, : start + 1]
    masses = torch.linspace(float(aircraft.mass_minimum_kg), float(aircraft.mass_maximum_kg), N_MASSES).double()
    nominal = nominal_descent(aircraft, levels, masses).time_s
    reference = nominal_descent(aircraft, levels).time_s
    return MassRange(levels, time - time[:, -1:], nominal, reference)


MOST_TICKS = 4
"""Ticks of the axis of rates, and one more."""


def mass_range_figure(
    flights: DescentSet, aircraft: PerformanceModel, *, n_lines: int = 50, seed: int = 0, title: str = ""
) -> Figure:
    """Flights' altitude over time, their rate and CAS by level, next to BADA's at the masses from least to largest.

    Args:
        flights: Flights on a grid.
        aircraft: Coefficients of their type.
        n_lines: Single flights drawn, picked at random (the paper's 50).
        seed: Of the picking.
        title: Written above all.

    Returns:
        A figure of three panels.

    Raises:
        DataError: See :func:`mass_range`.

    Example:
        >>> from descentflow.aircraft_types.open_types.open_aircraft import open_aircraft
        >>> from descentflow.representation.profiles import profiles_from_frame
        >>> from descentflow.surveillance.descents.prepared_descents import read_descents
        >>> aircraft = open_aircraft("A320")
        >>> profiles = profiles_from_frame(read_descents("descents.parquet").frame, aircraft, 150)
        >>> flights = DescentSet.of_profiles(profiles)
        >>> len(mass_range_figure(flights, aircraft, title="A320").axes)
        3
    """
    span = mass_range(flights, aircraft)
    figure, (axes,) = panels(11.5, 4.6, 1, 3, width_ratios=[1.5, 1, 1])
    _draw_times(axes[0], span, n_lines, seed)
    masses = torch.linspace(float(aircraft.mass_minimum_kg), float(aircraft.mass_maximum_kg), N_MASSES).double()
    by_mass = nominal_descent(aircraft, flights.levels_fl, masses)
    plain = nominal_descent(aircraft, flights.levels_fl)
    _draw_band(axes[1], flights, flights.rate_mps / FPM_MPS, by_mass.rate_mps / FPM_MPS, plain.rate_mps / FPM_MPS)
    _draw_band(axes[2], flights, flights.cas_mps / KT_MPS, by_mass.cas_mps / KT_MPS, plain.cas_mps / KT_MPS)
    axes[0].set(xlabel=f"Time since FL{float(span.levels_fl[-1]):.0f} (min)", ylabel="Flight level")
    axes[1].set_xlabel("Rate (ft/min)")
    # Numbers such as -3500 are wide, and more of them run into each other.
    axes[1].xaxis.set_major_locator(MaxNLocator(MOST_TICKS))
    axes[2].set_xlabel("CAS (kt)")
    low, high = span.range_s
    n, share = len(span.time_s), span.explained
    caption = f"BADA's masses: {low:.0f} to {high:.0f} s; {share:.0%} of {n:,} flights lie there"
    axes[0].set_title(caption, fontsize=9, loc="left")
    legend_below(figure, axes, columns=4)
    if title:
        figure.suptitle(title, fontsize=12, fontweight="bold")
    return figure


def _draw_times(ax: Axes, span: MassRange, n_lines: int, seed: int) -> None:
    picked = torch.randperm(len(span.time_s), generator=torch.Generator().manual_seed(seed))[:n_lines]
    for position, row in enumerate(span.time_s[picked] / 60):
        ax.plot(row, span.levels_fl, color=BLUE, linewidth=0.5, alpha=0.6, label=None if position else "flights")
    for position, row in enumerate(span.nominal_time_s[1:-1] / 60):
        label = None if position else "BADA, masses between"
        ax.plot(row, span.levels_fl, color=GREY, linewidth=0.9, label=label)
    for position, row in enumerate(span.nominal_time_s[[0, -1]] / 60):
        label = None if position else "BADA, least and largest mass"
        ax.plot(row, span.levels_fl, color=BLACK, linewidth=1.3, linestyle=(0, (5, 2)), label=label)
    ax.plot(span.reference_time_s / 60, span.levels_fl, color=BLACK, linewidth=2.0, label="BADA, reference mass")
    mean = span.time_s.mean(0) / 60
    ax.plot(mean, span.levels_fl, color=BLUE, linewidth=2.2, linestyle="--", label="mean of flights")
    ax.set_xlim(left=0)
    ax.set_ylim(float(span.levels_fl[0]), float(span.levels_fl[-1]))


def _draw_band(ax: Axes, flights: DescentSet, values: Tensor, by_mass: Tensor, plain: Tensor) -> None:
    """The flights' 5th to 95th percentile and mean at each level, and the band of all masses."""
    levels = flights.levels_fl
    enough = flights.mask.sum(0) >= MIN_FLIGHTS
    seen = torch.where(flights.mask, values.double(), torch.nan)
    low, high = (torch.where(enough, seen.nanquantile(q, 0), torch.nan) for q in (0.05, 0.95))
    ax.fill_betweenx(levels, low, high, color=BAND, linewidth=0, label="5-95 % of flights")
    spread = by_mass.expand(-1, len(levels)) if by_mass.shape[0] == N_MASSES else by_mass.expand(N_MASSES, -1)
    ax.fill_betweenx(
        levels, spread.amin(0), spread.amax(0), color=_BROWN, alpha=0.75, linewidth=0, label="BADA, all masses"
    )
    ax.plot(plain, levels, color=BLACK, linewidth=1.6)
    ax.plot(seen.nanmean(0), levels, color=BLUE, linewidth=2.0, linestyle="--")
    ax.set_ylim(float(levels[0]), float(levels[-1]))
