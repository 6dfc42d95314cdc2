"""Numbers, cells and words of the studies' pages."""

from functools import partial

from markupsafe import Markup as Html

from descentflow.reporting.pages import element

__all__ = ["Html", "bold", "cell", "code", "marked", "number", "paragraph", "percent"]

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
