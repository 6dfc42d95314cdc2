"""What an HTML page is made of: paragraphs, lists, boxes, tables, figures.

Every function takes text and returns :class:`Html`. A plain ``str`` is always text and is escaped, so that the name
of a flight or of a column can never become markup; only what is :class:`Html` is taken as it is.
"""

import base64
import io
import struct
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING

from descentflow.core.errors import DataError
from descentflow.core.files import whole_file

if TYPE_CHECKING:
    from matplotlib.figure import Figure

PNG_START = b"\x89PNG\r\n\x1a\n"


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
    """

    text: str
    kind: str = ""
    note: str = ""


def joined(*parts: str) -> Html:
    """Pieces of text and markup one after the other, the text escaped."""
    return Html("".join(part if isinstance(part, Html) else escape(part) for part in parts))


def bold(text: str) -> Html:
    """Text in bold."""
    return _element("b", text)


def code(text: str) -> Html:
    """Text in a typewriter face, as names of columns and hashes are set."""
    return _element("code", text)


def link(target: str, text: str) -> Html:
    """A link to an address, a file beside the page, or an anchor (``#name``)."""
    return Html(f'<a href="{escape(target)}">{joined(text)}</a>')


def marked(text: str, kind: str) -> Html:
    """Text in the colour of ``good``, ``bad`` or ``reference``."""
    return Html(f'<span class="{escape(kind)}">{joined(text)}</span>')


def lines(parts: Iterable[str]) -> Html:
    """Pieces below each other, as in one cell of a table."""
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
    """A paragraph in a box, for the answer of a page: ``good`` (green), ``warn`` or ``bad`` (red); empty is blue."""
    return _element("p", *parts, kind=f"box {kind}".strip())


def bullets(items: Iterable[str]) -> Html:
    """A list, one line per item."""
    return Html(f"<ul>{''.join(_element('li', item) for item in items)}</ul>")


def preformatted(text: str) -> Html:
    """Text whose spaces and lines are kept, such as a report for a terminal."""
    return _element("pre", text)


def subheading(text: str) -> Html:
    """A heading within a section."""
    return _element("h3", text)


def details(summary: str, *content: str) -> Html:
    """Content that is folded until the summary is clicked; on paper it is unfolded."""
    return Html(f"<details><summary>{joined(summary)}</summary>{blocks(content)}</details>")


def blocks(content: Iterable[str]) -> Html:
    """Content below each other; a plain string becomes a paragraph."""
    return Html("\n".join(part if isinstance(part, Html) else paragraph(part) for part in content))


def table(
    head: Sequence[str],
    rows: Iterable[Sequence[str | Cell]],
    *,
    align: str = "lr",
    caption: str = "",
    grouped: bool = False,
) -> Html:
    """A table that scrolls sideways where the screen is too narrow for it.

    Args:
        head: Names of the columns; an empty name is allowed.
        rows: One cell per column: text, markup, or a :class:`Cell`.
        align: A letter per column, ``l`` for words and ``r`` for numbers; the last letter holds for all columns that
            follow, so that ``lr`` is names first and numbers after them.
        caption: Above the table; empty for none.
        grouped: Rows that follow each other with the same first cell are one group: a line above the group, and
            the cell is shown once.

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
            _cell(cell, side, again and k == 0) for k, (cell, side) in enumerate(zip(cells, sides, strict=True))
        )
        body.append(f"<tr{_classes('group' * begins)}>{inner}</tr>")
    above = _element("caption", caption) if caption else ""
    return Html(
        f'<div class="scroll" tabindex="0"><table>{above}<thead><tr>{top}</tr></thead>'
        f"<tbody>{''.join(body)}</tbody></table></div>"
    )


def figure(picture: "Figure | bytes | Path", alt: str, caption: str = "", *, dpi: float = 100) -> Html:
    """A figure whose PNG is inside the page.

    Args:
        picture: A matplotlib figure, the bytes of a PNG, or a PNG's path.
        alt: What the figure shows, for readers who do not see it.
        caption: Below the figure; empty for none.
        dpi: Dots per inch of a matplotlib figure.

    Raises:
        DataError: If bytes or file are no PNG.

    Example:
        >>> from matplotlib.figure import Figure
        >>> figure(Figure(figsize=(2, 1)), "An empty figure")[:79]
        '<figure><div class="scroll" tabindex="0"><img alt="An empty figure" width="200"'
    """
    data = _png(picture, dpi)
    return _figure(f"data:image/png;base64,{base64.b64encode(data).decode('ascii')}", data, alt, caption)


def figure_beside(path: Path, picture: "Figure | bytes", alt: str, caption: str = "", *, dpi: float = 100) -> Html:
    """Write a figure's PNG to a file, whole, and show it in a page that lies in the same folder.

    Args:
        path: Of the PNG; its folder must exist.
        picture: A matplotlib figure or the bytes of a PNG.
        alt: What the figure shows, for readers who do not see it.
        caption: Below the figure; empty for none.
        dpi: Dots per inch of a matplotlib figure.

    Raises:
        DataError: If the folder does not exist, or the bytes are no PNG.
    """
    data = _png(picture, dpi)
    with whole_file(path) as temporary:
        temporary.write_bytes(data)
    return _figure(escape(path.name), data, alt, caption)


def _figure(source: str, data: bytes, alt: str, caption: str) -> Html:
    width, height = struct.unpack(">II", data[16:24])
    image = f'<img alt="{escape(alt)}" width="{width}" height="{height}" src="{source}">'
    below = _element("figcaption", caption) if caption else ""
    return Html(f'<figure><div class="scroll" tabindex="0">{image}</div>{below}</figure>')


def _png(picture: "Figure | bytes | Path", dpi: float) -> bytes:
    if not isinstance(picture, bytes | Path):
        buffer = io.BytesIO()
        # Without the version of matplotlib: the same figure is the same bytes.
        picture.savefig(buffer, format="png", dpi=dpi, metadata={"Software": None})
        return buffer.getvalue()
    data = picture.read_bytes() if isinstance(picture, Path) else picture
    if not data.startswith(PNG_START):
        name = str(picture) if isinstance(picture, Path) else "the bytes"
        raise DataError(f"{name}: no PNG", expected="a file that begins with PNG's signature", mend="save it as PNG")
    return data


def _cell(cell: Cell, side: str, again: bool) -> str:
    below = _element("small", cell.note) if cell.note else ""
    return f"<td{_classes('r' * (side == 'r'), cell.kind, 'again' * again)}>{joined(cell.text)}{below}</td>"


def _element(name: str, *parts: str, kind: str = "") -> Html:
    return Html(f"<{name}{_classes(kind)}>{joined(*parts)}</{name}>")


def _classes(*names: str) -> str:
    found = " ".join(name for name in names if name)
    return f' class="{escape(found)}"' if found else ""
