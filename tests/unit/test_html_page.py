"""The one builder of HTML pages: text is escaped, sections can be linked to, files are whole or not there."""

import re
from pathlib import Path

import matplotlib.figure
import pytest
from html_toys import Elements

from descentflow.core.errors import DataError
from descentflow.reporting import html_elements as html
from descentflow.reporting.html_figures import figure, figure_beside
from descentflow.reporting.html_page import CONTENTS_FROM, HtmlPage, anchor_of

HOSTILE = '<script>alert("x")</script>&"'


def small_figure() -> matplotlib.figure.Figure:
    figure = matplotlib.figure.Figure(figsize=(3, 2))
    figure.subplots().plot([0, 1])
    return figure


def full_page() -> HtmlPage:
    page = HtmlPage(HOSTILE, [HOSTILE, html.box(HOSTILE, kind="warn")])
    cells = [[HOSTILE, html.Cell(HOSTILE, "best", HOSTILE)], [html.bold(HOSTILE), "1"]]
    page.section(HOSTILE, HOSTILE, html.table([HOSTILE, "n"], cells, caption=HOSTILE))
    page.section("b", html.bullets([HOSTILE]), html.preformatted(HOSTILE), html.subheading(HOSTILE))
    page.section("c", html.details(HOSTILE, HOSTILE), html.paragraph(HOSTILE, html.link(HOSTILE, HOSTILE)))
    page.section("d", figure(small_figure(), HOSTILE, HOSTILE), html.code(HOSTILE), html.lines([HOSTILE, "2"]))
    return page


def test_text_never_becomes_markup() -> None:
    text = full_page().render()
    assert "<script" not in text
    parser = Elements()
    parser.feed(text)
    assert parser.open == []
    # What was escaped reads as it was given.
    assert [a["alt"] for tag, a in parser.seen if tag == "img"] == [HOSTILE]
    assert HOSTILE in [a.get("href") for tag, a in parser.seen if tag == "a"]


def test_markup_that_was_added_to_is_text_again() -> None:
    assert html.joined(html.bold("a") + "<b>") == "&lt;b&gt;a&lt;/b&gt;&lt;b&gt;"
    assert html.joined(html.bold("a"), "<b>") == "<b>a</b>&lt;b&gt;"


def test_a_page_needs_nothing_but_itself() -> None:
    text = full_page().render()
    assert text.startswith("<!doctype html>")
    assert '<meta name="viewport" content="width=device-width' in text
    assert re.findall(r'src="(?!data:image/png;base64,)', text) == []
    assert "http" not in text
    assert text == full_page().render()


def test_sections_are_listed_and_every_link_has_its_section() -> None:
    page = HtmlPage("Sections")
    for heading in ("Speed", "Speed", "speed!", "???")[:CONTENTS_FROM]:
        page.section(heading)
    text = page.render()
    ids = re.findall(r'<section id="([^"]+)"', text)
    assert ids == ["speed", "speed-2", "speed-3", "section"]
    assert re.findall(r'<a href="#([^"]+)"', text) == ids
    few = HtmlPage("Few")
    few.section("Speed", anchor="A320")
    assert "<nav" not in few.render()
    assert '<section id="A320">' in few.render()
    assert anchor_of(" CAS, above FL290 ") == "cas-above-fl290"


def test_numbers_stand_on_the_right_and_groups_show_their_name_once() -> None:
    rows = [["A320", "a", "1"], ["A320", "b", "2"], ["DH8D", "a", "3"]]
    text = html.table(["type", "what", "n"], rows, align="llr", grouped=True)
    assert text.count('<td class="r">') == 3
    assert text.count("again") == 1
    assert text.count('<tr class="group">') == 2
    with pytest.raises(DataError, match="row of 2 cells"):
        html.table(["type", "what", "n"], [["A320", "a"]])


def test_a_figure_is_inside_or_beside_the_page(tmp_path: Path) -> None:
    inside = figure(small_figure(), "A line", "Below")
    assert 'width="300" height="200"' in inside
    assert "<figcaption>Below</figcaption>" in inside
    beside = figure_beside(tmp_path / "line.png", small_figure(), "A line")
    assert 'src="line.png"' in beside
    assert figure(tmp_path / "line.png", "A line", "Below") == inside
    assert [p.name for p in tmp_path.iterdir()] == ["line.png"]
    with pytest.raises(DataError, match="no PNG"):
        figure(b"GIF89a", "Another format")


def test_a_page_is_written_whole_or_not_at_all(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "page.html"
    HtmlPage("Before").write(path)
    before = path.read_text(encoding="utf-8")

    def fail(*_: object, **__: object) -> None:
        raise OSError("disk full")

    monkeypatch.setattr(Path, "write_text", fail)
    with pytest.raises(OSError, match="disk full"):
        HtmlPage("After").write(path)
    assert path.read_text(encoding="utf-8") == before
    assert list(tmp_path.iterdir()) == [path]
    with pytest.raises(DataError, match="does not exist"):
        HtmlPage("Nowhere").write(tmp_path / "none" / "page.html")
