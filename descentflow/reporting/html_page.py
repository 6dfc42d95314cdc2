"""One builder of HTML pages with one style: everything inside one file, no script, written whole or not at all."""

import re
from collections.abc import Iterable
from pathlib import Path

from descentflow.core.files import whole_file
from descentflow.reporting.html_elements import Html, blocks, joined, link, paragraph
from descentflow.reporting.page_style import LANDSCAPE, STYLE

CONTENTS_FROM = 4
"""Sections from which a page lists them at its top."""


class HtmlPage:
    """A page: a title, what leads into it, and sections, each with a heading and an anchor.

    Content is made with :mod:`descentflow.reporting.html_elements`; a plain string among it becomes a paragraph and is
    escaped. The page reads well from 400 to 1,200 pixels, light and dark, and on paper.

    Args:
        title: Heading of the page and title of its window.
        lead: Sentences below the title; a plain string is set as a leading paragraph, markup is taken as it is.
        landscape: On paper, lay the page across: for wide tables.

    Example:
        >>> from descentflow.reporting.html_elements import table
        >>> page = HtmlPage("Flights of today", lead=["Two flights came down."])
        >>> page.section("By type", table(["type", "flights"], [["A320", "2"]]))
        >>> page.write(Path("today.html"))
        >>> "<title>Flights of today</title>" in Path("today.html").read_text()
        True
    """

    def __init__(self, title: str, lead: Iterable[str] = (), *, landscape: bool = False) -> None:
        self.title, self.landscape = title, landscape
        self.lead = [part if isinstance(part, Html) else paragraph(part, kind="lead") for part in lead]
        self._sections: dict[str, tuple[str, Html]] = {}

    def section(self, heading: str, *content: str, anchor: str = "") -> None:
        """Add a section.

        Args:
            heading: Plain text.
            content: Markup as it is; plain strings as paragraphs.
            anchor: For links to the section (``#anchor``); made of the heading where none is given.
        """
        self._sections[self._free(anchor or anchor_of(heading))] = (heading, blocks(content))

    def _free(self, anchor: str) -> str:
        """The anchor, or with a number where a section has it already."""
        names = (anchor, *(f"{anchor}-{k}" for k in range(2, len(self._sections) + 2)))
        return next(name for name in names if name not in self._sections)

    def render(self) -> str:
        """The whole page as text."""
        style, kind = STYLE + LANDSCAPE * self.landscape, ' class="landscape"' * self.landscape
        parts = [
            f'<!doctype html>\n<html lang="en"{kind}><head>',
            '<meta charset="utf-8"><meta name="viewport" content="width=device-width, initial-scale=1">',
            f"<title>{joined(self.title)}</title><style>{style}</style></head><body>",
            f"<h1>{joined(self.title)}</h1>",
            *self.lead,
            self._contents(),
        ]
        for anchor, (heading, content) in self._sections.items():
            parts.append(f'<section id="{joined(anchor)}"><h2>{joined(heading)}</h2>\n{content}\n</section>')
        return "\n".join([*filter(None, parts), "</body></html>\n"])

    def write(self, path: str | Path) -> None:
        """Write the page to a file, whole or not at all.

        Raises:
            DataError: If the file's folder does not exist, or the path is a folder.
        """
        with whole_file(path) as temporary:
            temporary.write_text(self.render(), encoding="utf-8")

    def _contents(self) -> str:
        if len(self._sections) < CONTENTS_FROM:
            return ""
        links = "".join(f"<li>{link('#' + a, heading)}</li>" for a, (heading, _) in self._sections.items())
        return f'<nav aria-label="Contents"><ul>{links}</ul></nav>'


def anchor_of(heading: str) -> str:
    """The name by which a link finds a heading: small letters, digits and hyphens.

    Example:
        >>> anchor_of("CAS at or below the transition altitude")
        'cas-at-or-below-the-transition-altitude'
    """
    return re.sub(r"[^a-z0-9]+", "-", heading.lower()).strip("-") or "section"
