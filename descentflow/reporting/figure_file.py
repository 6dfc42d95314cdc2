"""A figure as PNG or SVG: as bytes, and as a file of its own."""

import io
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from descentflow.core.errors import ConfigError
from descentflow.core.files import check_output, write_whole

if TYPE_CHECKING:
    from matplotlib.figure import Figure

ENDINGS = (".png", ".svg")
DPI = 130
"""Of PNG: text of 9 points is 16 pixels high, as on a page."""


def image(figure: "Figure", kind: Literal["png", "svg"] = "png", dpi: float = DPI) -> bytes:
    """A figure as PNG or SVG; the same figure is the same bytes, and letters of an SVG are shapes.

    Example:
        >>> from matplotlib.figure import Figure
        >>> image(Figure(), dpi=50)[1:4], image(Figure(), "svg")[:5]
        (b'PNG', b'<?xml')
    """
    import matplotlib as mpl

    buffer = io.BytesIO()
    with mpl.rc_context({"svg.fonttype": "path", "svg.hashsalt": "descentflow"}):
        figure.savefig(buffer, format=kind, dpi=dpi, metadata={"svg": {"Date": None}, "png": {"Software": None}}[kind])
    return buffer.getvalue()


def check_figure_file(path: str | Path) -> None:
    """Refuse a file that cannot be written, before the work.

    Raises:
        ConfigError: If its name ends in neither `.png` nor `.svg`.
        DataError: If its folder does not exist, or it is a folder.

    Example:
        >>> check_figure_file("samples.pdf")
        Traceback (most recent call last):
        descentflow.core.errors.ConfigError: figure samples.pdf; expected a name that ends in .png or .svg; ...
    """
    if Path(path).suffix.lower() not in ENDINGS:
        raise ConfigError(
            f"figure {path}", expected=f"a name that ends in {' or '.join(ENDINGS)}", mend="choose another name"
        )
    check_output(path)


def write_figure(figure: "Figure", path: str | Path, dpi: float = DPI) -> None:
    """Write a figure, whole or not at all; the same figure gives the same file.

    Raises:
        ConfigError: As :func:`check_figure_file`.
        DataError: As :func:`check_figure_file`.

    Example:
        >>> from matplotlib.figure import Figure
        >>> write_figure(Figure(), "empty.svg")
        >>> Path("empty.svg").read_text()[:5]
        '<?xml'
    """
    check_figure_file(path)
    write_whole(path, image(figure, "svg" if Path(path).suffix.lower() == ".svg" else "png", dpi))
