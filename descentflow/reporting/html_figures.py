"""Figures of an HTML page: their PNG inside the page, or in a file beside it."""

import base64
import io
import struct
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING

from descentflow.core.errors import DataError
from descentflow.core.files import whole_file
from descentflow.reporting.html_elements import Html, joined

if TYPE_CHECKING:
    from matplotlib.figure import Figure

PNG_START = b"\x89PNG\r\n\x1a\n"


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

    Example:
        >>> from matplotlib.figure import Figure
        >>> figure_beside(Path("times.png"), Figure(figsize=(2, 1)), "An empty figure")[41:]
        '<img alt="An empty figure" width="200" height="100" src="times.png"></div></figure>'
        >>> Path("times.png").is_file()
        True
    """
    data = _png(picture, dpi)
    with whole_file(path) as temporary:
        temporary.write_bytes(data)
    return _figure(escape(path.name), data, alt, caption)


def _figure(source: str, data: bytes, alt: str, caption: str) -> Html:
    width, height = struct.unpack(">II", data[16:24])
    image = f'<img alt="{escape(alt)}" width="{width}" height="{height}" src="{source}">'
    below = f"<figcaption>{joined(caption)}</figcaption>" if caption else ""
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
