"""The sections of the page that have figures, drawn at the same time by copies of this process."""

import gc
from collections.abc import Callable
from dataclasses import fields
from functools import partial

from descentflow.core.foreseen_calls import ForeseenCalls
from descentflow.core.forked import give_way
from descentflow.core.side_by_side import at_once
from descentflow.diagnosis.findings.findings import Findings
from descentflow.diagnosis.report.cause_section import cause_section
from descentflow.diagnosis.report.cost_section import cost_section
from descentflow.diagnosis.report.where_section import curves_section, where_section
from descentflow.reporting.html_elements import Html
from descentflow.reporting.svg_figures import drawing

SECTIONS: dict[str, Callable[[Findings], list[Html]]] = {
    "before and after": curves_section,
    "cost": cost_section,
    "where": where_section,
    "cause": cause_section,
}
"""Those that take longest first."""


class DrawnSections:
    """Draws the sections, in copies of this process where cores are shared.

    Example:
        >>> from descentflow.core.side_by_side import cores_shared
        >>> from descentflow.diagnosis.diagnose import diagnose
        >>> from descentflow.effects import EFFECTS
        >>> report = diagnose("descents.parquet", "A320", catalogue={"mass": EFFECTS["mass"]})
        >>> with cores_shared(), DrawnSections() as sections:
        ...     sections.load()
        ...     drawn = sections.of(report)
        >>> drawn["where"] == where_section(report)
        True
    """

    def __init__(self) -> None:
        """Begin with nothing drawn and nothing loaded."""
        self._calls: ForeseenCalls[tuple[str, Findings] | None, list[Html]] = ForeseenCalls(_answer, lambda key: None)
        self._loading = range(0)

    def __enter__(self) -> "DrawnSections":
        """Itself; no copy is left behind at the end of the block."""
        return self

    def __exit__(self, *_: object) -> None:
        self._calls.__exit__()

    def load(self) -> None:
        """Let copies load the library of figures, while this process has work that one core does."""
        self._loading = range(at_once())
        self._calls.foresee(dict.fromkeys(self._loading))

    def of(self, found: Findings) -> dict[str, list[Html]]:
        """Every section, by the names of :data:`SECTIONS`."""
        plain = Findings(**{one.name: getattr(found, one.name) for one in fields(Findings)})
        for place in self._loading:
            self._calls.ask(place, list)
        self._loading = range(0)
        self._calls.foresee({name: (name, plain) for name in SECTIONS})
        return {name: self._calls.ask(name, partial(section, found)) for name, section in SECTIONS.items()}


def _answer(question: tuple[str, Findings] | None) -> list[Html]:
    """In a copy: what a section holds; of no question, nothing, once figures can be drawn."""
    if question is None:
        # A process that ends with the page needs no search for garbage, and the library is wanted late.
        gc.disable()
        give_way()
        from descentflow.diagnosis.report.gap_figures import singles_figure

        # The first figure also finds the fonts.
        drawing(singles_figure([], [], [], str), "none")
        return []
    name, found = question
    return SECTIONS[name](found)
