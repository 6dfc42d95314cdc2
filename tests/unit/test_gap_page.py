"""The page of a diagnosis: no label cut or over another, wide and narrow; and what a manager asks is answered."""

import re
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from itertools import combinations
from pathlib import Path

import finding_toys
import pytest
from html_toys import Elements
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.text import Text

from descentflow.diagnosis.correction.recipe import recipe_of
from descentflow.diagnosis.findings.cause_found import ClosedShare, ParameterEstimate, TradeSize
from descentflow.diagnosis.findings.costs_found import Measured
from descentflow.diagnosis.findings.findings import Curve, Findings, SingleEffect
from descentflow.diagnosis.findings.plain_values import percent
from descentflow.diagnosis.findings.selection_found import DetectionLimit
from descentflow.diagnosis.report.both_sides import BothSides, told_of_both
from descentflow.diagnosis.report.cause_section import _causes
from descentflow.diagnosis.report.gap_figures import costs_figure, curves_figure, singles_figure, where_figure
from descentflow.diagnosis.report.gap_page import _left, page
from descentflow.diagnosis.report.inputs_section import inputs_section
from descentflow.diagnosis.report.next_steps import next_steps
from descentflow.diagnosis.report.text import sentences, summary
from descentflow.diagnosis.report.where_section import _curves_in_words
from descentflow.diagnosis.report.words import limit_flights
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


@cache
def page_of(verdict: str) -> str:
    """Drawn once for all tests that only read it."""
    return page(of_verdict(verdict))


@pytest.mark.parametrize("verdict", ["none", "effect", "partial", "unknown"])
def test_the_page_is_whole_and_needs_nothing_else(verdict: str) -> None:
    text = page_of(verdict)
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
    parser.feed(page_of(verdict))
    said = [a["aria-label"] or "" for _, a in parser.seen if a.get("role") == "img"]
    # Four figures, each for both widths.
    assert len(said) == 8
    for text in said:
        assert re.search(r"\d|Alone", text), text


def test_three_sentences_name_the_simulator_the_cost_and_the_cause() -> None:
    for verdict in ("none", "effect", "partial", "unknown"):
        *told, lacks = sentences(of_verdict(verdict))
        assert len(told) == 3
        assert "lacks, beside any cause: noise of the vertical rate (x 3)" in lacks
        assert told[0].startswith("house_simulator.parquet and the 400 real A20N flights differ by")
        for word in ("spreads", "nats", "relative"):
            assert word not in " ".join(told)
    first, second, third, _ = sentences(of_verdict("partial"))
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
    assert "DLH4AB-3" in page_of("unknown")
    assert "DLH4AB-3" not in page_of("effect")


def test_inputs_versions_and_settings_are_named() -> None:
    text = page_of("effect")
    for word in ("radar.parquet", "2026-10-01 to 2026-10-31", "descentflow", "0.1.0", "own_effects.py", "october.csv"):
        assert word in text


def test_names_of_flights_never_become_markup() -> None:
    found = of_verdict("unknown")
    flight = replace(found.flights_worth_a_look[0], flight="<script>alert(1)</script>")
    assert "<script" not in page(replace(found, flights_worth_a_look=[flight]))


def steps_of(found: Findings) -> str:
    return "\n".join(next_steps(found))


def left_of(found: Findings) -> str:
    return "".join(_left(found))


def test_commands_can_be_run_from_where_their_reader_is() -> None:
    found = replace(of_verdict("partial"), corrected_file="corrected.ckpt")
    told = summary(found, Path("there/gap"))
    assert "`descentflow sample there/gap/corrected.ckpt -n 1000 --out samples.parquet`" in told
    assert "`--previous there/gap/gap.json`" in told
    # The page lies beside them, and shows as a command what is one.
    text = page(found)
    assert "<code>descentflow sample corrected.ckpt -n 1000 --out samples.parquet</code>" in text
    assert "<code>--previous gap.json</code>" in text


def test_parts_of_a_recipe_are_numbered_where_there_are_several() -> None:
    found = of_verdict("effect")
    assert "(1) ISA + 7.2 K [6.8, 7.6]; (2) CD0 x 1.58" in steps_of(found)
    assert "(1)" not in steps_of(replace(found, recipe=found.recipe[:1]))


def test_a_share_that_is_told_as_all_is_not_told_as_a_percentage() -> None:
    most = replace(finding_toys.brakes(), share_of_flights=ClosedShare(0.9991, 0.996, 1.0))
    found = replace(of_verdict("effect"), causes=[most])
    for told in (_causes(found), summary(found)):
        assert "nearly all flights" in told
        assert "100 % of the flights" not in told
        assert "100 % (100 % to 100 %)" not in told
    (step,) = recipe_of([most], EFFECTS, (150.0, 350.0))
    assert step.text.endswith("FL190 to FL265, in nearly all flights")


def test_what_an_effect_does_not_do_to_reports_is_not_told() -> None:
    brakes = finding_toys.brakes()
    for noise, is_told in ((1.0, False), (1.3, True)):
        told = f"short-scale noise x {noise:.2f}"
        size = TradeSize("ln_ratio_noise", told, f"{told} (1.00 to 1.40)", "factor", Measured(noise, 1.0, 1.4))
        found = replace(of_verdict("effect"), causes=[replace(brakes, sizes=[*brakes.sizes, size])])
        assert (told in _causes(found)) is is_told
        assert (told in summary(found)) is is_told


def test_a_difference_is_entered_under_a_name() -> None:
    more = TradeSize("deviation_k", "+4.8 K", "+4.8 K (+4.4 to +5.2)", "K", Measured(4.8, 4.4, 5.2))
    (step,) = recipe_of([replace(finding_toys.warm(), sizes=[more])], EFFECTS, (150.0, 350.0))
    assert step.text == "temperature +4.8 K (+4.4 to +5.2), FL150 to FL350"


def test_each_of_several_sizes_keeps_its_name_where_the_simulator_s_own_is_not_known() -> None:
    bias = EFFECTS["airspeed_bias"]
    sizes = [
        TradeSize(p.name, f"{p.label} +1 kt", f"{p.label} +1 kt (+0 to +2)", "kt", Measured(1.0, 0.0, 2.0))
        for p in bias.parameters
    ]
    assert told_of_both(bias, sizes, BothSides(True)) == sizes


def test_limits_are_told_as_sizes_of_the_flights_that_have_the_effect() -> None:
    found = of_verdict("none")
    limits = [
        DetectionLimit("speed_brake", "extra_cd0", 1.1, "factor", "parasitic drag added, mean over all flights", 0.61),
        DetectionLimit("measurement_noise", "ln_ratio_cas", 1.14, "factor", "ln of the ratio of the noise of IAS"),
    ]
    path = DetectionLimit("geometric_path", "share", 6.0, "%", "share of the flights on a path")
    found = replace(found, details=replace(found.details, detection_limits=limits))
    text = left_of(found)
    for told in ("CD0 x 1.10", "61 % of them", "noise of IAS x 1.14"):
        assert told in text
    assert [limit_flights(limit) for limit in (*limits, path)] == ["61 % of them", "all", "-"]
    for wrong in ("mean over all flights", "ln of the ratio"):
        assert wrong not in text
    assert "from CD0 x 1.10 and noise of IAS x 1.14 on they would be named in 80 of 100 cases" in steps_of(found)


def test_what_is_left_is_set_beside_chance() -> None:
    found = of_verdict("effect")
    # The toy's curves have an error of 0.4 % of the rate, and 2 % are left.
    assert "2.0 times what would not matter, and 5.0 standard errors." in left_of(found)
    little = replace(found.remaining, largest=replace(found.remaining.largest, difference=0.006))
    assert "and no more than chance often gives." in left_of(replace(found, remaining=little))


def test_where_nothing_is_put_in_nothing_is_drawn_as_after() -> None:
    curves = finding_toys.details().curves
    drawn = curves_figure(curves, ["rate"], finding_toys.details().profile, after=False)
    assert [text.get_text() for text in drawn.legends[0].get_texts()] == ["what chance gives (95 %)", "before"]
    shown = ["rate", "tas"]
    assert "levels before and" in _curves_in_words(of_verdict("effect"), shown)
    assert _curves_in_words(of_verdict("none"), shown).endswith("true airspeed against Mach number at 14 of 14 levels.")


def test_a_slope_of_the_wind_is_no_wind_at_a_level() -> None:
    size = TradeSize("slope_per_s", "tailwind +2.1 kt per 1,000 ft", "tailwind +2.1", "kt per 1,000 ft", Measured(2.1))
    wind = finding_toys.cause(
        "wind_gradient", {"slope_per_s": ParameterEstimate(0.0035, None, None, "1")}, sizes=[size]
    )
    text = page(replace(of_verdict("effect"), causes=[wind]))
    assert "by how much the mean wind itself differs is left in the distance over ground" in text
    assert "Let the wind change about the mean wind that each flight has" in text
    assert "mean wind" not in steps_of(of_verdict("effect"))


def test_the_time_at_equal_speed_is_told_where_a_speed_is_a_cause_and_the_time_is_alike() -> None:
    sizes = {"bias_kt": ParameterEstimate(3.2, 3.1, 3.4, "kt")}
    costs = [replace(c, before=Measured(4.0, -9.0, 17.0)) if c.name == "time" else c for c in finding_toys.costs()]
    found = replace(of_verdict("effect"), causes=[finding_toys.cause("airspeed_bias", sizes)], costs=costs)
    assert "25 s of time at equal speed become 1.5 s" in sentences(found)[2]


def test_no_share_is_less_than_nothing() -> None:
    assert [percent(x) for x in (-0.004, 0.0, -0.006)] == ["0 %", "0 %", "-1 %"]


def test_both_sides_are_told_by_version() -> None:
    table = inputs_section(of_verdict("effect"))[1]
    assert '<td data-name="descentflow">0.1.0</td>' in table
