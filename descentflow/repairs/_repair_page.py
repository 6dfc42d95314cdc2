"""The page of a repair: errors on aircraft that were not used, what was changed, and what could not be."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from descentflow.core.files import table_beside
from descentflow.repairs.flight_evidence import BAND_FL
from descentflow.repairs.held_out import Error
from descentflow.repairs.repair_found import CoefficientEstimate, Repair
from descentflow.reporting.pages import drawing, rendered

if TYPE_CHECKING:
    from matplotlib.figure import Figure

WIDTH_IN = 3.2
LABELS, COUNTS, FILES = (table_beside(__file__)[words] for words in ("labels", "counts", "files"))
"""Words of coefficients, of what was counted, and of files."""


def page(repair: Repair, paths: Mapping[str, Path]) -> str:
    """The page as HTML.

    Args:
        repair: The repair.
        paths: Files next to it.

    Example:
        >>> from descentflow.repairs.repair import repair
        >>> page(repair("descents.parquet", aircraft="A320"), {})[:15]
        '<!doctype html>'
    """
    judged = repair.held_out
    figures = [
        ("Error of the rate of descent by level, before and after", "rate", "rate, model minus flights (ft/min)"),
        ("Error of the scheduled CAS by level, before and after", "cas", "scheduled CAS minus flights' (kt)"),
    ]
    return rendered(
        "repairs/repair.html.j2",
        repair=repair,
        judged=judged,
        levels=_levels(repair),
        figures=[(alt, drawing(_level_figure(repair, which, title))) for alt, which, title in figures],
        changes=[[LABELS[estimate.name], *_numbers(estimate)] for estimate in repair.estimates],
        counts=[COUNTS[name].format(value) for name, value in repair.counts.items() if name in COUNTS and value],
        sisters=[f"{number} of {code}" for code, number in repair.flights.items() if code != repair.before.typecode],
        files=[[paths[kind].name, what] for kind, what in FILES.items() if kind in paths],
        sizes=_sizes(repair),
    )


def _levels(repair: Repair) -> list[list[str]]:
    rows = []
    for which, label, form in (("rate", "rate, ft/min", "+.0f"), ("cas", "scheduled CAS, kt", "+.1f")):
        for level in repair.held_out.levels:
            name = f"{label}, FL{level.level_fl:.0f} ({level.aircraft} aircraft)"
            rows.append([name, *_signed(getattr(level, which), form)])
    return rows


def _signed(error: Error, form: str) -> list[str]:
    after = f"{error.after:{form}} ({error.low:{form}} to {error.high:{form}})"
    return [f"{error.before:{form}}", after, f"{error.floor:{form}}".lstrip("+")]


def _numbers(one: CoefficientEstimate) -> list[str]:
    changed = f"{100 * (one.after / one.before - 1):+.0f} %" if not one.aircraft and one.before else ""
    return [f"{one.before:.4g}", f"{one.after:.4g}", changed, f"{one.low:.4g} to {one.high:.4g}", one.source]


def _sizes(repair: Repair) -> list[list[str]]:
    sizes = repair.posterior.sizes
    named = {
        "between aircraft": sizes.aircraft,
        "between flights of an aircraft": sizes.flight,
        "mass of a flight": sizes.mass,
        "smooth in altitude": sizes.smooth,
        "of one band": sizes.white,
    }
    return [[name, f"{100 * size:.1f} %"] for name, size in named.items()]


def _level_figure(repair: Repair, which: str, title: str) -> "Figure":
    from descentflow.reporting.figure_style import BLUE, RED, panels, say_why_empty

    figure, ((ax,),) = panels(WIDTH_IN, 3.4)
    levels = [level.level_fl for level in repair.held_out.levels]
    errors: Sequence[Error] = [getattr(level, which) for level in repair.held_out.levels]
    if not errors:
        say_why_empty(ax, "no level is shown by three aircraft")
    else:
        half = BAND_FL / 2
        for level, error in zip(levels, errors, strict=True):
            ax.fill_betweenx([level - half, level + half], -error.floor, error.floor, color="#dddddd", linewidth=0)
            ax.plot([error.low, error.high], [level, level], color=BLUE, linewidth=1.4)
        ax.axvline(0.0, color="#888888", linewidth=0.8)
        ax.plot([error.before for error in errors], levels, "o", color=RED, markersize=5, label="before")
        after = [error.after for error in errors]
        ax.plot(after, levels, "s", color=BLUE, markersize=5, markerfacecolor="white", label="after")
        ax.set_ylabel("flight level", fontsize=9)
    ax.set_title(title, fontsize=9, loc="left")
    return figure
