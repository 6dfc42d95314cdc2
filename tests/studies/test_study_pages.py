"""Pages of studies: text is escaped, sections can be linked to, files are whole or not there."""

import re
from pathlib import Path

import matplotlib.figure
import pytest
from html_toys import Elements
from jinja2 import UndefinedError

from descentflow.core.errors import DataError
from descentflow.reporting.pages import drawing, figure, png, rendered
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


def test_markup_that_was_added_to_is_text_again() -> None:
    assert element("b", "a") + "<b>" == "<b>a</b>&lt;b&gt;"


def test_a_page_needs_nothing_but_itself() -> None:
    text = full_page().render()
    assert text.startswith("<!doctype html>")
    assert '<meta name="viewport" content="width=device-width' in text
    assert re.findall(r'src="(?!data:image/png;base64,)', text) == []
    assert "http" not in text
    assert text == full_page().render()


def test_sections_are_listed_and_every_link_has_its_section() -> None:
    page = HtmlPage("Sections")
    for heading in ("Speed", "Speed", "speed!", "???"):
        page.section(heading)
    text = page.render()
    ids = re.findall(r'<section id="([^"]+)"', text)
    assert ids == ["speed", "speed-2", "speed-3", "section"]
    assert re.findall(r'<a href="#([^"]+)"', text) == ids


def test_numbers_stand_on_the_right_and_groups_show_their_name_once() -> None:
    rows = [["A320", "a", "1"], ["A320", "b", "2"], ["DH8D", "a", "3"]]
    text = table(["type", "what", "n"], rows, align="llr", grouped=True)
    assert text.count("<td class=r>") == 3
    assert text.count("again") == 1
    assert text.count("<tr class=group>") == 2


def test_a_name_that_a_template_does_not_get_is_an_error() -> None:
    with pytest.raises(UndefinedError, match="report"):
        rendered("surveillance/cleaning_page.html.j2", flights=[])


def test_the_same_figure_is_the_same_image(tmp_path: Path) -> None:
    (tmp_path / "line.png").write_bytes(png(small_figure(), 100))
    assert figure(tmp_path / "line.png", "A line") == figure(small_figure(), "A line")
    assert drawing(small_figure()) == drawing(small_figure())


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
