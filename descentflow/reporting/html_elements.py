"""Elements of an HTML page: paragraphs, lists, boxes, tables.

Every function takes text and returns :class:`Html`. A plain ``str`` is always text and is escaped, so that the name
of a flight or of a column can never become markup; only what is :class:`Html` is taken as it is.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from html import escape

from descentflow.core.errors import DataError


class Html(str):
    """Markup that is put into a page as it is. Any other string is text.

    Adding to it or formatting it gives a plain string again, which is escaped: join pieces with :func:`joined`.

    Example:
        >>> joined("FL100 < ", Html("<b>FL290</b>"))
        'FL100 &lt; <b>FL290</b>'
    """

    __slots__ = ()


@dataclass(frozen=True)
class Cell:
    """A cell of a table that is more than plain text.

    Attributes:
        text: Text, or :class:`Html`.
        kind: ``best`` (bold), ``reference`` (muted), ``good`` or ``bad`` (coloured); empty for none.
        note: Small text below.

    Example:
        >>> "0.71<small>of 20 flights</small>" in table(["score"], [[Cell("0.71", "best", "of 20 flights")]])
        True
    """

    text: str
    kind: str = ""
    note: str = ""


def joined(*parts: str) -> Html:
    """Pieces of text and markup one after the other, the text escaped.

    Example:
        >>> joined("drag < ", bold("thrust"))
        'drag &lt; <b>thrust</b>'
    """
    return Html("".join(part if isinstance(part, Html) else escape(part) for part in parts))


def bold(text: str) -> Html:
    """Text in bold.

    Example:
        >>> bold("A320")
        '<b>A320</b>'
    """
    return _element("b", text)


def code(text: str) -> Html:
    """Text in a typewriter face, as names of columns and hashes are set.

    Example:
        >>> code("vertical_rate")
        '<code>vertical_rate</code>'
    """
    return _element("code", text)


def link(target: str, text: str) -> Html:
    """A link to an address, a file beside the page, or an anchor (``#name``).

    Example:
        >>> link("gap.json", "all numbers")
        '<a href="gap.json">all numbers</a>'
    """
    return Html(f'<a href="{escape(target)}">{joined(text)}</a>')


def marked(text: str, kind: str) -> Html:
    """Text in the colour of ``good``, ``bad`` or ``reference``.

    Example:
        >>> marked("named", "good")
        '<span class="good">named</span>'
    """
    return Html(f'<span class="{escape(kind)}">{joined(text)}</span>')


def lines(parts: Iterable[str]) -> Html:
    """Pieces below each other, as in one cell of a table.

    Example:
        >>> lines([bold("mass"), "lighter aircraft"])
        '<b>mass</b><br>lighter aircraft'
    """
    return Html("<br>".join(joined(part) for part in parts))


def paragraph(*parts: str, kind: str = "") -> Html:
    """A paragraph of text and markup.

    Args:
        parts: Joined without spaces between them.
        kind: ``lead`` (larger), ``note`` (smaller, muted), ``reference`` (muted); empty for running text.

    Example:
        >>> paragraph("Time of ", bold("<A320>"), " in seconds.")
        '<p>Time of <b>&lt;A320&gt;</b> in seconds.</p>'
    """
    return _element("p", *parts, kind=kind)


def box(*parts: str, kind: str = "") -> Html:
    """A paragraph in a box, for the answer of a page: ``good`` (green), ``warn`` or ``bad`` (red); empty is blue.

    Example:
        >>> box("No gap.", kind="good")
        '<p class="box good">No gap.</p>'
    """
    return _element("p", *parts, kind=f"box {kind}".strip())


def answer(sentences: Iterable[str], kind: str = "") -> Html:
    """Sentences in a box, each on a line of its own: the answer of a page; kinds as :func:`box` has them.

    Example:
        >>> answer(["They differ.", "The cause is known."], "warn")
        '<div class="box warn"><p>They differ.</p><p>The cause is known.</p></div>'
    """
    inner = "".join(_element("p", sentence) for sentence in sentences)
    return Html(f'<div class="{escape(f"box {kind}".strip())}">{inner}</div>')


def bullets(items: Iterable[str]) -> Html:
    """A list, one line per item.

    Example:
        >>> bullets(["geoaltitude", "groundspeed"])
        '<ul><li>geoaltitude</li><li>groundspeed</li></ul>'
    """
    return Html(f"<ul>{''.join(_element('li', item) for item in items)}</ul>")


def preformatted(text: str) -> Html:
    """Text whose spaces and lines are kept, such as a report for a terminal.

    Example:
        >>> preformatted("kept   90 %")
        '<pre>kept   90 %</pre>'
    """
    return _element("pre", text)


def subheading(text: str) -> Html:
    """A heading within a section.

    Example:
        >>> subheading("Times of descent")
        '<h3>Times of descent</h3>'
    """
    return _element("h3", text)


def details(summary: str, *content: str) -> Html:
    """Content that is folded until the summary is clicked; on paper it is unfolded.

    Example:
        >>> details("Settings", "seed 0")
        '<details><summary>Settings</summary><p>seed 0</p></details>'
    """
    return Html(f"<details><summary>{joined(summary)}</summary>{blocks(content)}</details>")


def blocks(content: Iterable[str]) -> Html:
    r"""Content below each other; a plain string becomes a paragraph.

    Example:
        >>> blocks([subheading("Flights"), "120 of them"])
        '<h3>Flights</h3>\n<p>120 of them</p>'
    """
    return Html("\n".join(part if isinstance(part, Html) else paragraph(part) for part in content))


def table(
    head: Sequence[str],
    rows: Iterable[Sequence[str | Cell]],
    *,
    align: str = "lr",
    caption: str = "",
    grouped: bool = False,
    stacked: bool = False,
) -> Html:
    """A table that scrolls sideways where the screen is too narrow for it, or has its cells below each other there.

    Args:
        head: Names of the columns; an empty name is allowed.
        rows: One cell per column: text, markup, or a :class:`Cell`.
        align: A letter per column, ``l`` for words and ``r`` for numbers; the last letter holds for all columns that
            follow, so that ``lr`` is names first and numbers after them.
        caption: Above the table; empty for none.
        grouped: Rows that follow each other with the same first cell are one group: a line above the group, and
            the cell is shown once.
        stacked: On narrow screens, a row's cells stand below each other, each with its column's name.

    Raises:
        DataError: If a row has not as many cells as there are columns.

    Example:
        >>> print(table(["type", "flights"], [["A320", "1,200"]]).replace("><tr", ">" + chr(10) + "<tr"))
        <div class="scroll" tabindex="0"><table><thead>
        <tr><th scope="col">type</th><th scope="col" class="r">flights</th></tr></thead><tbody>
        <tr><td>A320</td><td class="r">1,200</td></tr></tbody></table></div>
    """
    sides = [align[min(k, len(align) - 1)] if align else "l" for k in range(len(head))]
    top = "".join(
        f'<th scope="col"{_classes("r" * (s == "r"))}>{joined(h)}</th>' for h, s in zip(head, sides, strict=True)
    )
    body, last = [], None
    for row in rows:
        cells = [cell if isinstance(cell, Cell) else Cell(cell) for cell in row]
        if len(cells) != len(head):
            raise DataError(
                f"a table's row of {len(cells)} cells", expected=f"{len(head)}: {', '.join(head)}", mend="fill the row"
            )
        begins = grouped and cells[0].text != last
        again = grouped and not begins
        last = cells[0].text
        inner = "".join(
            _cell(cell, sides[k], again and k == 0, head[k] if stacked and k else "") for k, cell in enumerate(cells)
        )
        body.append(f"<tr{_classes('group' * begins)}>{inner}</tr>")
    above = _element("caption", caption) if caption else ""
    return Html(
        f'<div class="{"stack" if stacked else "scroll"}" tabindex="0"><table>{above}<thead><tr>{top}</tr></thead>'
        f"<tbody>{''.join(body)}</tbody></table></div>"
    )


def stacked_table(
    head: Sequence[str], rows: Iterable[Sequence[str | Cell]], *, align: str = "lr", caption: str = ""
) -> Html:
    """A table whose cells stand below each other on narrow screens, see :func:`table`.

    Example:
        >>> '<td class="r" data-name="flights">1,200</td>' in stacked_table(["type", "flights"], [["A320", "1,200"]])
        True
    """
    return table(head, rows, align=align, caption=caption, stacked=True)


def _cell(cell: Cell, side: str, again: bool, name: str) -> str:
    below = _element("small", cell.note) if cell.note else ""
    named = f' data-name="{escape(name)}"' if name else ""
    return f"<td{_classes('r' * (side == 'r'), cell.kind, 'again' * again)}{named}>{joined(cell.text)}{below}</td>"


def _element(name: str, *parts: str, kind: str = "") -> Html:
    return Html(f"<{name}{_classes(kind)}>{joined(*parts)}</{name}>")


def _classes(*names: str) -> str:
    found = " ".join(name for name in names if name)
    return f' class="{escape(found)}"' if found else ""
