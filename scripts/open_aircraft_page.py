"""Write one page on the open aircraft: python scripts/open_aircraft_page.py PAGE.html [TYPE ...]."""

import sys
from collections.abc import Iterable
from pathlib import Path

from markupsafe import Markup

from descentflow.aircraft_types.open_types.open_aircraft import CoefficientSource, open_type, open_typecodes
from descentflow.reporting.pages import figure
from studies.aircraft.open_aircraft_figures import open_aircraft_figure
from studies.page_elements import HtmlPage, element, table

INTRODUCTION = """
These coefficients have the form of BADA 3 and are not EUROCONTROL's BADA: they come from open sources, each with a
stated confidence. Each figure shows the nominal descent in still, standard air from the type's ceiling (FL390 at most)
to 1,500 ft, for a low mass (1.2 times the minimum), the reference mass and the maximum landing mass. Shaded: ranges of
rate and speed that others published for the type, where they hold; where nothing is shaded, none is known.
"""


def coefficients(entries: Iterable[CoefficientSource]) -> Markup:
    """One row per number."""
    rows = []
    for e in entries:
        value = ", ".join(f"{v:g}" for v in e.value) if isinstance(e.value, tuple) else str(e.value)
        rows.append((e.name, value, e.unit, e.confidence, e.source))
    return table(["name", "value", "unit", "confidence", "source"], rows, align="lrl")


def content(typecode: str) -> list[str]:
    """All about one type."""
    read = open_type(typecode)
    related = [f"Made from {read.relation}. {read.relation_stated}."] if read.relation else []
    tables = {"Coefficients": read.coefficients, "Facts": read.facts, "Published ranges": read.published}
    folded = [
        part for name, entries in tables.items() if entries for part in (element("h3", name), coefficients(entries))
    ]
    picture = figure(open_aircraft_figure(typecode), f"Nominal descent of the {typecode}", dpi=110)
    off = element("p", element("b", "Known to be off."), " ", read.known_to_be_off)
    return [
        f"{read.summary}. Real flights: {read.judged_by}.",
        *related,
        picture,
        off,
        element("details", element("summary", "Numbers and sources"), *folded),
    ]


def main(path: str, *typecodes: str) -> None:
    chosen = typecodes or open_typecodes()
    page = HtmlPage("Open aircraft of descentflow", [INTRODUCTION])
    for typecode in chosen:
        page.section(typecode, *content(typecode))
    page.write(path)
    print(f"{path}: {len(chosen)} types, {Path(path).stat().st_size / 1e6:.1f} MB")


if __name__ == "__main__":
    main(*sys.argv[1:])
