"""HTML pages by jinja2 templates, and figures inside them.

A page extends `page.html.j2` and takes its tables and figures from `elements.html.j2`, both in this folder.
A template `x.html.j2` escapes whatever it is given, so that the name of a flight never becomes markup.
"""

import base64
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

from jinja2 import ChoiceLoader, Environment, FunctionLoader, PackageLoader, StrictUndefined
from markupsafe import Markup

from descentflow.reporting.figure_file import image

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def rendered(template: str, **values: Any) -> str:
    """Text of a template of the package.

    Args:
        template: Its path below the package's folder.
        values: What it shows, by name; a name that it does not find is an error.

    Example:
        >>> text = rendered("surveillance/cleaning_page.html.j2", flights=[], report="no rows < 1")
        >>> text[:15], "<pre>no rows &lt; 1</pre>" in text
        ('<!doctype html>', True)
    """
    return environment().get_template(template).render(**values)


@cache
def environment() -> Environment:
    """Templates of the package, by their path below its folder.

    Example:
        >>> environment().get_template("reporting/elements.html.j2").module.side("lr", 1)
        Markup(' class=r')
    """
    package = PackageLoader("descentflow", ".")

    def escaped(name: str) -> tuple[str, str | None, Any]:
        """A template of text under the name of a page: what pages import must be escaped as they are."""
        return package.get_source(made, name.replace(".html.j2", ".txt.j2"))

    made = Environment(
        loader=ChoiceLoader([package, FunctionLoader(escaped)]),
        autoescape=lambda name: name is not None and name.endswith(".html.j2"),
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    return made


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
    data = picture.read_bytes() if isinstance(picture, Path) else image(picture, dpi=dpi)
    made = cast("Any", environment().get_template("reporting/elements.html.j2").module)
    return Markup(made.figure(_uri("png", data), alt, caption))


def drawing(picture: "Figure") -> str:
    """A figure as the address of an SVG image inside the page, sharp at every size; letters are shapes.

    Example:
        >>> from matplotlib.figure import Figure
        >>> drawing(Figure())[:26], drawing(Figure()) == drawing(Figure())
        ('data:image/svg+xml;base64,', True)
    """
    return _uri("svg+xml", image(picture, "svg"))


def _uri(kind: str, data: bytes) -> str:
    return f"data:image/{kind};base64,{base64.b64encode(data).decode('ascii')}"
