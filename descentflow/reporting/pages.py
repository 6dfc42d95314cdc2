"""HTML pages: jinja2 templates that a page extends, tables and figures inside them.

A template `x.html.j2` escapes whatever it is given, so that the name of a flight never becomes markup; only
:class:`markupsafe.Markup` is taken as it is.
"""

import base64
import io
import re
from collections.abc import Iterable, Sequence
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup, escape

from descentflow.core.files import whole_file

if TYPE_CHECKING:
    from matplotlib.figure import Figure

ELEMENTS = "reporting/elements.html.j2"
"""Template of tables and figures."""


def rendered(template: str, **values: Any) -> str:
    """Text of a template of the package.

    Args:
        template: Its path below the package's folder.
        values: What it shows, by name; a name that it does not find is an error.

    Example:
        >>> print(rendered("reporting/sections.html.j2", title="A < B", lead=[], sections={})[:15])
        <!doctype html>
    """
    return _environment().get_template(template).render(**values)


@cache
def _environment() -> Environment:
    return Environment(
        loader=PackageLoader("descentflow", "."),
        autoescape=lambda name: name is not None and name.endswith(".html.j2"),
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )


def element(name: str, *parts: str, kind: str = "") -> Markup:
    """An element of text and markup, such as ``b``, ``code`` or a ``span`` of a kind that the style sheet knows.

    Example:
        >>> element("span", "named <", kind="good")
        Markup('<span class="good">named &lt;</span>')
    """
    chosen = Markup(' class="{}"').format(kind) if kind else ""
    return Markup("<{0}{1}>{2}</{0}>").format(name, chosen, Markup("").join(map(escape, parts)))


def table(
    head: Sequence[str], rows: Iterable[Sequence[str]], *, align: str = "lr", caption: str = "", grouped: bool = False
) -> Markup:
    """A table that scrolls sideways where the screen is too narrow for it.

    Args:
        head: Names of the columns.
        rows: One cell for each column, text or markup.
        align: A letter for each column, ``l`` for words and ``r`` for numbers; the last one holds for all that follow.
        caption: Above the table; empty for none.
        grouped: Rows with the same first cell, one after the other, are a group that shows it once.

    Example:
        >>> "<td class=r>1,200</td>" in table(["type", "flights"], [["A320", "1,200"]])
        True
    """
    made = cast("Any", _environment().get_template(ELEMENTS).module)
    return Markup(made.table(head, list(rows), align, caption, grouped))


def figure(picture: "Figure | Path", alt: str, caption: str = "", *, dpi: float = 100) -> Markup:
    """A figure whose PNG is inside the page.

    Args:
        picture: A matplotlib figure, or a PNG's path.
        alt: What the figure shows, for readers who do not see it.
        caption: Below the figure; empty for none.
        dpi: Dots per inch of a matplotlib figure.

    Example:
        >>> from matplotlib.figure import Figure
        >>> figure(Figure(figsize=(2, 1)), "An empty figure")[:50]
        Markup('<figure><img alt="An empty figure" src="data:image')
    """
    data = picture.read_bytes() if isinstance(picture, Path) else png(picture, dpi)
    made = cast("Any", _environment().get_template(ELEMENTS).module)
    return Markup(made.figure(_uri("png", data), alt, caption))


def png(picture: "Figure", dpi: float) -> bytes:
    """A figure as PNG; the same figure is the same bytes.

    Example:
        >>> from matplotlib.figure import Figure
        >>> png(Figure(), 50)[1:4]
        b'PNG'
    """
    buffer = io.BytesIO()
    picture.savefig(buffer, format="png", dpi=dpi, metadata={"Software": None})
    return buffer.getvalue()


def drawing(picture: "Figure") -> str:
    """A figure as the address of an SVG image inside the page, sharp at every size; letters are shapes.

    Example:
        >>> from matplotlib.figure import Figure
        >>> drawing(Figure())[:26], drawing(Figure()) == drawing(Figure())
        ('data:image/svg+xml;base64,', True)
    """
    import matplotlib as mpl

    buffer = io.BytesIO()
    with mpl.rc_context({"svg.fonttype": "path", "svg.hashsalt": "descentflow"}):
        picture.savefig(buffer, format="svg", metadata={"Date": None})
    return _uri("svg+xml", buffer.getvalue())


def _uri(kind: str, data: bytes) -> str:
    return f"data:image/{kind};base64,{base64.b64encode(data).decode('ascii')}"


class HtmlPage:
    """A page of sections one after the other: text, tables and figures.

    Args:
        title: Heading of the page.
        lead: Paragraphs below it.

    Example:
        >>> page = HtmlPage("Flights of today", ["Two flights came down."])
        >>> page.section("By type", table(["type", "flights"], [["A320", "2"]]))
        >>> page.write("today.html")
        >>> "<title>Flights of today</title>" in Path("today.html").read_text()
        True
    """

    def __init__(self, title: str, lead: Iterable[str] = ()) -> None:
        self.title, self.lead = title, list(lead)
        self._sections: dict[str, tuple[str, Sequence[str]]] = {}

    def section(self, heading: str, *content: str) -> None:
        """Add a section of markup and of plain strings, which become paragraphs; links find it by its heading."""
        name = re.sub(r"[^a-z0-9]+", "-", heading.lower()).strip("-") or "section"
        again = sum(re.sub(r"-\d+$", "", other) == name for other in self._sections)
        self._sections[f"{name}-{again + 1}" if again else name] = (heading, content)

    def render(self) -> str:
        """Text of the whole page."""
        return rendered("reporting/sections.html.j2", title=self.title, lead=self.lead, sections=self._sections)

    def write(self, path: str | Path) -> None:
        """Write the page to a file, whole or not at all.

        Raises:
            DataError: If the file's folder does not exist, or the path is a folder.
        """
        with whole_file(path) as temporary:
            temporary.write_text(self.render(), encoding="utf-8")
