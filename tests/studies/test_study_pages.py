"""Pages of studies: text is escaped, sections can be linked to, files are whole or not there."""

import re

import matplotlib.figure
import pytest
from html_toys import Elements
from jinja2 import UndefinedError

from descentflow.reporting.pages import figure, rendered
from studies.page_elements import HtmlPage, element, table

HOSTILE = '<script>alert("x")</script>&"'


def small_figure() -> matplotlib.figure.Figure:
    figure = matplotlib.figure.Figure(figsize=(3, 2))
    figure.subplots().plot([0, 1])
    return figure


def full_page() -> HtmlPage:
    page = HtmlPage(HOSTILE, [HOSTILE, element("p", HOSTILE, kind=HOSTILE)])
    cells = [[HOSTILE, element("small", HOSTILE)], [element("b", HOSTILE), "1"]]
    page.section(HOSTILE, HOSTILE, table([HOSTILE, "n"], cells, caption=HOSTILE))
    page.section("b", figure(small_figure(), HOSTILE, HOSTILE))
    page.section("c", table([HOSTILE], [[HOSTILE], [HOSTILE]], grouped=True))
    page.section("d", element("code", HOSTILE))
    return page


def test_text_never_becomes_markup() -> None:
    text = full_page().render()
    assert "<script" not in text
    parser = Elements()
    parser.feed(text)
    assert parser.open == []
    # What was escaped reads as it was given.
    assert [a["alt"] for tag, a in parser.seen if tag == "img"] == [HOSTILE]


def test_sections_are_listed_and_every_link_has_its_section() -> None:
    page = HtmlPage("Sections")
    for heading in ("Speed", "Speed", "speed!", "???"):
        page.section(heading)
    text = page.render()
    ids = re.findall(r'<section id="([^"]+)"', text)
    assert ids == ["speed", "speed-2", "speed-3", "section"]
    assert re.findall(r'<a href="#([^"]+)"', text) == ids


def test_a_name_that_a_template_does_not_get_is_an_error() -> None:
    with pytest.raises(UndefinedError, match="report"):
        rendered("surveillance/cleaning_page.html.j2", flights=[])
