"""Write one page on the open aircraft: python scripts/open_aircraft_page.py PAGE.html [TYPE ...]."""

import base64
import html
import io
import os
import sys
from collections.abc import Iterable
from pathlib import Path

from descentflow.aircraft_types.open_types.open_aircraft import CoefficientSource, open_type, open_typecodes
from descentflow.studies.aircraft.open_aircraft_figures import open_aircraft_figure

STYLE = """
body { font: 15px/1.5 system-ui, sans-serif; max-width: 1150px; margin: 2em auto; padding: 0 1em; color: #222; }
img { width: 100%; height: auto; } h2 { margin-top: 2.2em; border-bottom: 1px solid #ccc; }
table { border-collapse: collapse; font-size: 13px; } td, th { padding: 2px 10px 2px 0; text-align: left;
vertical-align: top; border-bottom: 1px solid #eee; } summary { cursor: pointer; margin: 0.6em 0; }
"""

INTRODUCTION = """
These coefficients have the form of BADA 3 and are not EUROCONTROL's BADA: they come from open sources, each with a
stated confidence. Each figure shows the nominal descent in still, standard air from the type's ceiling (FL390 at most)
to 1,500 ft, for a low mass (1.2 times the minimum), the reference mass and the maximum landing mass. Shaded: ranges of
rate and speed that others published for the type, where they hold; where nothing is shaded, none is known.
"""


def image(typecode: str) -> str:
    """Figure of a type as an embedded PNG."""
    buffer = io.BytesIO()
    open_aircraft_figure(typecode).savefig(buffer, format="png", dpi=110, metadata={"Software": None})
    return "data:image/png;base64," + base64.b64encode(buffer.getvalue()).decode("ascii")


def table(entries: Iterable[CoefficientSource]) -> str:
    """One row per number."""
    head = "<tr><th>name</th><th>value</th><th>unit</th><th>confidence</th><th>source</th></tr>"
    rows = []
    for e in entries:
        value = ", ".join(f"{v:g}" for v in e.value) if isinstance(e.value, tuple) else str(e.value)
        cells = (e.name, value, e.unit, e.confidence, e.source)
        rows.append("<tr>" + "".join(f"<td>{html.escape(c)}</td>" for c in cells) + "</tr>")
    return f"<table>{head}{''.join(rows)}</table>"


def section(typecode: str) -> str:
    """All about one type."""
    read = open_type(typecode)
    related = f"<p>Made from {read.relation}. {html.escape(read.relation_stated)}.</p>" if read.relation else ""
    tables = {"Coefficients": read.coefficients, "Facts": read.facts, "Published ranges": read.published}
    folded = "".join(f"<h3>{name}</h3>{table(entries)}" for name, entries in tables.items() if entries)
    return (
        f'<h2 id="{typecode}">{typecode}</h2><p>{html.escape(read.summary)}.</p>{related}'
        f'<img alt="Nominal descent of the {typecode}" src="{image(typecode)}">'
        f"<p><b>Known to be off.</b> {html.escape(read.known_to_be_off)}</p>"
        f"<details><summary>Numbers and sources</summary>{folded}</details>"
    )


def main(page: str, *typecodes: str) -> None:
    chosen = typecodes or open_typecodes()
    links = " ".join(f'<a href="#{t}">{t}</a>' for t in chosen)
    text = (
        f'<!doctype html><html lang="en"><head><meta charset="utf-8"><title>Open aircraft of descentflow</title>'
        f"<style>{STYLE}</style></head><body><h1>Open aircraft of descentflow</h1><p>{INTRODUCTION}</p><p>{links}</p>"
        f"{''.join(section(t) for t in chosen)}</body></html>\n"
    )
    path = Path(page)
    unfinished = path.with_name(path.name + ".part")
    unfinished.write_text(text, encoding="utf-8")
    os.replace(unfinished, path)
    print(f"{path}: {len(chosen)} types, {path.stat().st_size / 1e6:.1f} MB")


if __name__ == "__main__":
    main(*sys.argv[1:])
