"""Pieces of a self-contained HTML page: style, tables, pictures, numbers."""

import base64
import html
import io
from collections.abc import Iterable, Sequence
from pathlib import Path

from matplotlib.figure import Figure

STYLE = """
body { font: 15px/1.5 system-ui, sans-serif; max-width: 1240px; margin: 2em auto; padding: 0 1em; color: #222; }
h1 { line-height: 1.2; } h2 { margin-top: 2.2em; border-bottom: 1px solid #ccc; } h3 { margin-bottom: 0.3em; }
nav { columns: 3; font-size: 14px; } nav a { color: #0060a0; text-decoration: none; display: block; }
figure { margin: 1em 0; } figure img { max-width: 100%; height: auto; display: block; }
figcaption { color: #555; font-size: 13px; }
.wide { overflow-x: auto; }
table { border-collapse: collapse; font-size: 13px; margin: 0.6em 0; font-variant-numeric: tabular-nums; }
td, th { padding: 2px 9px; text-align: right; border-bottom: 1px solid #e4e4e4; vertical-align: top; }
thead th { border-bottom: 1px solid #888; vertical-align: bottom; }
td.word, th.word { text-align: left; white-space: nowrap; }
tr.first td { border-top: 1px solid #999; }
.best { font-weight: bold; } .paper { color: #777; }
small { display: block; color: #777; font-weight: normal; font-size: 11px; white-space: nowrap; }
@page { size: A4 landscape; margin: 11mm; }
@media print {
  body { max-width: none; margin: 0; font-size: 11px; } table { font-size: 9.5px; } small { font-size: 8px; }
  td, th { padding: 1px 5px; } h2 { break-after: avoid; } nav { display: none; }
  figure { break-inside: avoid; } figure img { max-height: 142mm; } tr { break-inside: avoid; }
  .wide { overflow: visible; }
}
"""

Cell = str | tuple[str, str] | tuple[str, str, str]
"""Text, its class, and small text below it."""


def page(title: str, sections: Sequence[tuple[str, str]], introduction: str) -> str:
    """A whole page with a list of its sections at the top.

    Args:
        title: Heading of the page.
        sections: Heading and HTML of each; headings are plain text.
        introduction: HTML below the title.
    """
    links = "".join(f'<a href="#s{k}">{html.escape(heading)}</a>' for k, (heading, _) in enumerate(sections))
    body = "".join(
        f'<h2 id="s{k}">{html.escape(heading)}</h2>{content}' for k, (heading, content) in enumerate(sections)
    )
    head = f"<!doctype html><html lang=en><meta charset=utf-8><title>{html.escape(title)}</title>"
    head += f"<style>{STYLE}</style>"
    return f"{head}<h1>{html.escape(title)}</h1>{introduction}<nav>{links}</nav>{body}</html>"


def rows(head: Sequence[str], lines: Iterable[Sequence[Cell]], words: int = 1) -> str:
    """A table.

    Args:
        head: Names of columns.
        lines: Cells of each row; where the first cell is that of the row above it is left empty.
        words: Leading columns of text, set to the left.
    """
    top = "".join(f"<th{_word(k, words)}>{html.escape(c)}</th>" for k, c in enumerate(head))
    body, last = "", None
    for line in lines:
        name = line[0] if isinstance(line[0], str) else line[0][0]
        mark = ' class="first"' if name != last else ""
        if name == last:
            line = ["", *line[1:]]
        last = name
        body += f"<tr{mark}>{''.join(_cell(cell, k < words) for k, cell in enumerate(line))}</tr>"
    return f'<div class="wide"><table><thead><tr>{top}</tr></thead><tbody>{body}</tbody></table></div>'


def _word(position: int, words: int) -> str:
    return ' class="word"' if position < words else ""


def _cell(cell: Cell, word: bool) -> str:
    parts = (cell,) if isinstance(cell, str) else cell
    kinds = " ".join(filter(None, ["word" if word else "", parts[1] if len(parts) > 1 else ""]))
    below = f"<small>{html.escape(parts[2])}</small>" if len(parts) > 2 and parts[2] else ""
    mark = f' class="{kinds}"' if kinds else ""
    return f"<td{mark}>{html.escape(parts[0])}{below}</td>"


def picture(path: Path, caption: str) -> str:
    """A PNG inside the page."""
    return picture_of(path.read_bytes(), caption)


def picture_of(data: bytes, caption: str) -> str:
    """A PNG's bytes inside the page; the caption is plain text."""
    text = html.escape(caption)
    encoded = base64.b64encode(data).decode("ascii")
    return f'<figure><img alt="{text}" src="data:image/png;base64,{encoded}"><figcaption>{text}</figcaption></figure>'


def png(figure: Figure) -> bytes:
    """A figure as PNG for a page."""
    data = io.BytesIO()
    figure.savefig(data, format="png", dpi=100)
    return data.getvalue()


def number(value: float | None, digits: int = 3) -> str:
    """Digits that are worth reading; a dash for none.

    Example:
        >>> number(1234), number(0.12345), number(123.4), number(None)
        ('1,234', '0.123', '123', '-')
    """
    if value is None or value != value:
        return "-"
    if isinstance(value, int):
        return f"{value:,}"
    return f"{value:,.0f}" if abs(value) >= 100 else f"{value:.{digits}g}"
