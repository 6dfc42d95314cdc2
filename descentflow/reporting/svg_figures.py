"""Figures of an HTML page as drawings inside it: one for wide screens and paper, one for narrow screens.

They are sharp at every magnification. What is drawn with a tip (:func:`with_tip`) shows it where the pointer rests.
"""

import io
import re
from collections.abc import Callable
from html import escape
from typing import TYPE_CHECKING

from descentflow.reporting.html_elements import Html, joined

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.figure import Figure

TIP = "tip:"
"""Begins the identifier of what has a tip."""


def with_tip(artist: "Artist", text: str) -> None:
    """Say what something drawn means, where the pointer rests on it.

    Example:
        >>> from matplotlib.figure import Figure
        >>> figure = Figure()
        >>> (point,) = figure.subplots().plot([1.0], [2.0], "o")
        >>> with_tip(point, "two at one")
        >>> "<title>two at one</title>" in drawing(figure, "a")
        True
    """
    artist.set_gid(TIP + text)


def drawn_for_both(draw: "Callable[[bool], Figure]", name: str, alt: str, caption: str = "") -> Html:
    """A figure drawn twice: wide, and narrow for screens of less than 900 pixels; only one of them is shown.

    Args:
        draw: Makes the figure, narrow if true.
        name: Of the figure, one of its kind on the page.
        alt: What the figure shows, for readers who do not see it: its finding, not its kind.
        caption: Below the figure; empty for none.

    Example:
        >>> from matplotlib.figure import Figure
        >>> html = drawn_for_both(lambda narrow: Figure((3, 2) if narrow else (9, 3)), "times", "Both take 520 s.")
        >>> html.count("<svg"), html.count('aria-label="Both take 520 s."')
        (2, 2)
    """
    drawn = [_drawn(draw, name, alt, kind) for kind in ("wide", "narrow")]
    below = f"<figcaption>{joined(caption)}</figcaption>" if caption else ""
    return Html(f"<figure>{''.join(drawn)}{below}</figure>")


def _drawn(draw: "Callable[[bool], Figure]", name: str, alt: str, kind: str) -> str:
    """One of the two, at the size of its text: larger it need not be, smaller it is made to fit."""
    figure = draw(kind == "narrow")
    inside, width = drawing(figure, f"{name}-{kind}"), 100 * figure.get_figwidth()
    return (
        f'<div class="drawing {kind}" role="img" aria-label="{escape(alt)}" style="max-width:{width:.0f}px">'
        f"{inside}</div>"
    )


def drawing(figure: "Figure", name: str) -> Html:
    """A matplotlib figure as an SVG element whose identifiers are its own; letters are shapes, so none is cut.

    Args:
        figure: To be drawn.
        name: Begins all identifiers.

    Example:
        >>> from matplotlib.figure import Figure
        >>> drawing(Figure(figsize=(3, 2)), "empty")[:4], drawing(Figure(), "a") == drawing(Figure(), "a")
        ('<svg', True)
    """
    import matplotlib as mpl

    buffer = io.StringIO()
    # Without date and with a salt of its own: the same figure is the same text.
    with mpl.rc_context({"svg.fonttype": "path", "svg.hashsalt": name}):
        figure.savefig(buffer, format="svg", metadata={"Date": None, "Creator": None, "Format": None, "Type": None})
    text = buffer.getvalue()
    text = text[text.index("<svg") :]
    text = re.sub(r"<metadata>.*?</metadata>", "", text, flags=re.DOTALL)
    text = re.sub(r"<!--.*?-->", "", text, flags=re.DOTALL)
    text = re.sub(rf"""<g id=(["']){TIP}(.*?)\1>""", r"<g><title>\2</title>", text)
    # Its one rule would hold for all of the page.
    text = re.sub(r"<style.*?</style>", "", text, count=1, flags=re.DOTALL)
    text = re.sub(r'\bid="([^"]*)"', rf'id="{name}-\1"', text)
    text = re.sub(r'href="#([^"]*)"', rf'href="#{name}-\1"', text)
    text = re.sub(r"url\(#([^)]*)\)", rf"url(#{name}-\1)", text)
    # The page says how large it is.
    text = re.sub(r'(<svg[^>]*?) width="[^"]*"', r"\1", text, count=1)
    text = re.sub(r'(<svg[^>]*?) height="[^"]*"', r"\1", text, count=1)
    return Html(re.sub(r"\s*\n\s*", "\n", text).strip())
