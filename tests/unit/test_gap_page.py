"""The page of a diagnosis: no label cut or over another, wide and narrow; and what a manager asks is answered."""

import re
from collections.abc import Callable
from dataclasses import replace
from itertools import combinations

import finding_toys
import pytest
from html_toys import Elements
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.text import Text

from descentflow.diagnosis.findings.findings import Curve, Findings, SingleEffect
from descentflow.diagnosis.report.gap_figures import costs_figure, curves_figure, singles_figure, where_figure
from descentflow.diagnosis.report.gap_page import page
from descentflow.diagnosis.report.text import sentences, summary
from descentflow.effects import EFFECTS
from descentflow.measurements.quantity_registry import BY_BAND

LEVELS: list[float | None] = [157.5 + 15 * k for k in range(14)]
DRAW: dict[str, Callable[[bool], Figure]] = {}


def drawn(draw: Callable[[bool], Figure]) -> Callable[[bool], Figure]:
    DRAW[draw.__name__] = draw
    return draw


@drawn
def costs(narrow: bool) -> Figure:
    return costs_figure(finding_toys.costs(), narrow=narrow)


@drawn
def where(narrow: bool) -> Figure:
    """Every quantity there is, with numbers of four digits."""
    curves = {q: Curve(LEVELS, [-0.6 + 0.1 * k for k in range(14)], [0.0] * 14, [0.02] * 14) for q in BY_BAND}
    curves["height"] = Curve(LEVELS, [300.0 + k for k in range(14)], [0.0] * 14, [3.0] * 14)
    return where_figure(curves, finding_toys.details().profile, narrow=narrow)


@drawn
def curves(narrow: bool) -> Figure:
    """The four quantities of the longest names."""
    longest = ["rate", "lag", "tas", "height"]
    every = {q: Curve(LEVELS, [0.5 * k for k in range(14)], [0.1] * 14, [0.02] * 14) for q in longest}
    return curves_figure(every, longest, finding_toys.details().profile, narrow=narrow)


@drawn
def singles(narrow: bool) -> Figure:
    rows = [SingleEffect(name, 9000.0 / (1 + k) ** 3, 10.0, {}) for k, name in enumerate(EFFECTS)]
    label = lambda name: EFFECTS[name].text  # noqa: E731
    return singles_figure(rows, ["temperature"], ["mass"], label, narrow=narrow)


@pytest.mark.parametrize("narrow", [False, True])
@pytest.mark.parametrize("name", sorted(DRAW))
def test_no_label_is_cut_or_over_another(name: str, narrow: bool) -> None:
    figure = DRAW[name](narrow)
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    renderer = canvas.get_renderer()
    texts = [t for t in figure.findobj(Text) if t.get_visible() and t.get_text().strip()]
    for axes in figure.axes:
        # Ticks beyond the limits are there and not drawn.
        for axis in (axes.xaxis, axes.yaxis):
            low, high = sorted(axis.get_view_interval())
            hidden = [tick.label1 for tick in axis.get_major_ticks() if not low <= tick.get_loc() <= high]
            texts = [t for t in texts if t not in hidden]
        if not axes.get_visible():
            texts = [t for t in texts if t.axes is not axes]
    boxes = {t.get_text(): t.get_window_extent(renderer) for t in texts if t.get_window_extent(renderer).width > 0}
    assert len(boxes) > 5
    for text, box in boxes.items():
        assert 0 <= box.x0 <= box.x1 <= figure.bbox.width, text
        assert 0 <= box.y0 <= box.y1 <= figure.bbox.height, text
    every = [(t.get_text(), t.get_window_extent(renderer)) for t in texts]
    for (first, a), (second, b) in combinations(every, 2):
        # Half a pixel is rounding.
        apart = a.x1 <= b.x0 + 0.5 or b.x1 <= a.x0 + 0.5 or a.y1 <= b.y0 + 0.5 or b.y1 <= a.y0 + 0.5
        assert apart, f"{first!r} over {second!r}"


def of_verdict(verdict: str) -> Findings:
    found = finding_toys.findings()
    if verdict in ("none", "unknown"):
        costs = [replace(cost, after=None) for cost in found.costs]
        return replace(found, verdict=verdict, causes=[], recipe=[], costs=costs, below_rounding=[])  # type: ignore[arg-type]
    return replace(found, verdict=verdict)  # type: ignore[arg-type]


@pytest.mark.parametrize("verdict", ["none", "effect", "partial", "unknown"])
def test_the_page_is_whole_and_needs_nothing_else(verdict: str) -> None:
    text = page(of_verdict(verdict))
    parser = Elements()
    parser.feed(text)
    assert parser.open == []
    tags = [tag for tag, _ in parser.seen]
    assert "script" not in tags
    assert "link" not in tags
    # Every identifier once, and whatever is referred to is there: drawings do not take each other's parts.
    ids = [a["id"] for _, a in parser.seen if a.get("id")]
    assert len(ids) == len(set(ids))
    used = re.findall(r'href="#([^"]+)"', text) + re.findall(r"url\(#([^)]+)\)", text)
    assert set(used) <= set(ids)
    assert re.findall(r'(?:src|href)="https?:', text) == []


@pytest.mark.parametrize("verdict", ["none", "effect", "partial", "unknown"])
def test_alternative_texts_say_what_a_figure_shows(verdict: str) -> None:
    parser = Elements()
    parser.feed(page(of_verdict(verdict)))
    said = [a["aria-label"] or "" for _, a in parser.seen if a.get("role") == "img"]
    # Four figures, each for both widths.
    assert len(said) == 8
    for text in said:
        assert re.search(r"\d|Alone", text), text


def test_three_sentences_name_the_simulator_the_cost_and_the_cause() -> None:
    for verdict in ("none", "effect", "partial", "unknown"):
        told = sentences(of_verdict(verdict))
        assert len(told) == 3
        assert told[0].startswith("house_simulator.parquet and the 400 real A20N flights differ by")
        for word in ("spreads", "nats", "relative"):
            assert word not in " ".join(told)
    first, second, third = sentences(of_verdict("partial"))
    assert "take 25 s (22 to 28) longer" in first
    assert "CD0 x 1.58 between FL190 and FL265 in 62 % of the flights" in second
    assert "the true airspeed against Mach number (FL150 to FL195) goes from +5.8 kt to 0.0 kt" in third
    assert "25 s of time at equal speed become 1.5 s (noise floor 3.0 s)" in third
    assert "a gap of no named cause" in third


def test_sizes_are_those_of_the_flights_that_have_the_effect() -> None:
    found = of_verdict("effect")
    assert "62 % (58 % to 66 %)" in page(found)
    assert "CD0 x 1.58 (1.54 to 1.62)" in summary(found)


def test_what_to_do_next_has_recipe_channel_and_command() -> None:
    text = page(replace(of_verdict("partial"), corrected_file="corrected.ckpt"))
    steps = text[text.index("What to do next</h2>") : text.index("Where they differ</h2>")]
    assert "ISA + 7.2 K [6.8, 7.6]" in steps
    assert "Add TAS: it would tell temperature and mass apart" in steps
    assert "descentflow sample corrected.ckpt" in steps
    assert "DLH4AB-3 (+41 s)" in steps


def test_flights_are_named_only_where_something_is_not_explained() -> None:
    assert "DLH4AB-3" in page(of_verdict("unknown"))
    assert "DLH4AB-3" not in page(of_verdict("effect"))


def test_inputs_versions_and_settings_are_named() -> None:
    text = page(of_verdict("effect"))
    for word in ("radar.parquet", "2026-10-01 to 2026-10-31", "descentflow", "0.1.0", "own_effects.py", "october.csv"):
        assert word in text


def test_names_of_flights_never_become_markup() -> None:
    found = of_verdict("unknown")
    flight = replace(found.flights_worth_a_look[0], flight="<script>alert(1)</script>")
    assert "<script" not in page(replace(found, flights_worth_a_look=[flight]))
