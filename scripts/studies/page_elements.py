"""Pages of studies: sections of text, tables and figures, and how their numbers and cells are written."""

import re
from collections.abc import Iterable, Sequence
from functools import cache, partial
from pathlib import Path
from typing import Any, cast

from jinja2 import ChoiceLoader, Environment, FileSystemLoader
from markupsafe import Markup as Html
from markupsafe import escape

from descentflow.core.files import write_whole
from descentflow.reporting.pages import environment

__all__ = ["Html"]  # under the name of this module


@cache
def _templates() -> Environment:
    here = FileSystemLoader(Path(__file__).parent)
    package = environment()
    assert package.loader is not None
    return package.overlay(loader=ChoiceLoader([package.loader, here]))


def _elements() -> Any:
    return cast("Any", _templates().get_template("reporting/elements.html.j2").module)


def element(name: str, *parts: str, kind: str = "") -> Html:
    """An element of text and markup, such as ``b``, ``code`` or a ``span`` of a kind that the style sheet knows.

    Example:
        >>> element("span", "named <", kind="good")
        Markup('<span class="good">named &lt;</span>')
    """
    chosen = Html(' class="{}"').format(kind) if kind else ""
    return Html("<{0}{1}>{2}</{0}>").format(name, chosen, Html("").join(map(escape, parts)))


def table(
    head: Sequence[str], rows: Iterable[Sequence[str]], *, align: str = "lr", caption: str = "", grouped: bool = False
) -> Html:
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
    return Html(_elements().table(head, list(rows), align, caption, grouped))


bold, code, paragraph = partial(element, "b"), partial(element, "code"), partial(element, "p")


def marked(text: str, kind: str) -> Html:
    """Text in the colour of ``good``, ``bad`` or ``reference``.

    Example:
        >>> marked("named", "good")
        Markup('<span class="good">named</span>')
    """
    return element("span", text, kind=kind)


def cell(text: str, kind: str = "", note: str = "") -> Html:
    """A cell of a table: ``best`` is bold, ``reference`` muted; a note stands small below.

    Example:
        >>> cell("0.71", "best", "of 20 flights")
        Markup('<span class="best">0.71</span><small>of 20 flights</small>')
    """
    return Html("").join([element("span", text, kind=kind), *([element("small", note)] if note else [])])


def number(value: float | None, digits: int = 3) -> str:
    """Digits that are worth reading, of an integer all with separators; a dash for none.

    Example:
        >>> number(1234), number(0.12345), number(123.4), number(None)
        ('1,234', '0.123', '123', '-')
    """
    if value is None or value != value:
        return "-"
    if isinstance(value, int):
        return f"{value:,}"
    return f"{value:,.0f}" if abs(value) >= 100 else f"{value:.{digits}g}"


def percent(share: float | None) -> str:
    """A share (1 is all) in percent; a dash for none.

    Example:
        >>> percent(0.256), percent(None)
        ('26 %', '-')
    """
    return "-" if share is None else f"{100 * share:.0f} %"


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
        values = {"title": self.title, "lead": self.lead, "sections": self._sections}
        return _templates().get_template("sections.html.j2").render(values)

    def write(self, path: str | Path) -> None:
        """Write the page to a file, whole or not at all.

        Raises:
            DataError: If the file's folder does not exist, or the path is a folder.
        """
        write_whole(path, self.render())
