"""The page and the terminal text of a diagnosis: the numbers of `gap.json`, in their order, in plain words."""

import re
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from html import unescape
from html.parser import HTMLParser
from itertools import combinations
from pathlib import Path

import finding_toys
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.text import Text

from descentflow.diagnosis.findings.cause_found import ClosedShare, OnBothSides, ParameterEstimate, ReportedSize
from descentflow.diagnosis.findings.costs_found import Measured
from descentflow.diagnosis.findings.findings import Curve, Findings
from descentflow.diagnosis.findings.inputs_found import Provenance
from descentflow.diagnosis.inference._described import recipe_of
from descentflow.diagnosis.report.figures import cost_figure, level_figure
from descentflow.diagnosis.report.page import next_command, page, summary
from descentflow.effects import EFFECTS

VERDICTS = ("none", "effect", "partial", "unknown")
NOT_WORDS = (
    "with a probability of 100 %",
    "distributions of all that is compared",
    "of that between flights",
    "but not as what it is",
    "held-out flights alone",
    "house_simulator.parquet and",
    "spreads",
    "nats",
    " told",
    "worked out",
    "gives way",
)
"""Words that neither page nor terminal has."""


CLOSE_THEMSELVES = ("meta", "img", "br")


class Elements(HTMLParser):
    """Elements with their attributes, in order; fails where one is closed that is not the last that was opened."""

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.seen: list[tuple[str, dict[str, str | None]]] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.seen.append((tag, dict(attrs)))
        if tag not in CLOSE_THEMSELVES:
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag


def of_verdict(verdict: str) -> Findings:
    findings = finding_toys.findings()
    if verdict in ("none", "unknown"):
        costs = [replace(cost, after=None) for cost in findings.costs]
        return replace(findings, verdict=verdict, causes=[], recipe=[], costs=costs, below_rounding=[])  # type: ignore[arg-type]
    return replace(findings, verdict=verdict)  # type: ignore[arg-type]


@cache
def page_of(verdict: str) -> str:
    """Drawn once for all tests that only read it."""
    return page(of_verdict(verdict))


def words_of(text: str) -> str:
    """Text that a reader of a page sees, a paragraph or cell in a line."""
    body = re.sub(r"<style>.*?</style>", "", text, flags=re.DOTALL)
    body = re.sub(r"\n", " ", body)
    body = re.sub(r"</(?:p|td|th|li|h1|h2|h3|tr|summary)>", "\n", body)
    return unescape(re.sub(r"<[^>]+>", "", body))


@pytest.mark.parametrize("verdict", VERDICTS)
def test_the_page_is_whole_and_needs_nothing_else(verdict: str) -> None:
    text = page_of(verdict)
    parser = Elements()
    parser.feed(text)
    assert parser.open == []
    tags = [tag for tag, _ in parser.seen]
    assert "script" not in tags
    assert "link" not in tags
    images = [a for tag, a in parser.seen if tag == "img"]
    assert len(images) == 6
    for image in images:
        assert (image["src"] or "").startswith("data:image/svg+xml;base64,")
        assert re.search(r"\d", image["alt"] or "")


def test_costs_and_what_each_cause_takes_away_come_first_and_then_what_to_change() -> None:
    words = words_of(page_of("partial"))
    places = [
        words.index(part)
        for part in (
            "Real flights minus the simulator: +25 s, +2.0 NM, -110 ft/min",
            "Temperature takes away: +12 s, +1.2 NM, -55 ft/min",
            "+25 s (+22 to +28)",
            "What to change in the simulator",
            "ISA + 7.2 K [6.8, 7.6]",
            "How sure, and what else it could be",
            "mass: mass x 0.93 (0.91 to 0.95)",
            "What is left",
            "What the simulator lacks besides",
            "Noise of the vertical rate (x 3.00)",
            "What would decide",
            "TAS would separate temperature and mass.",
            "DLH4AB-3 (+41 s)",
            "What went in",
            "Numbers for specialists",
        )
    ]
    assert places == sorted(places)


def test_a_time_that_may_differ_stands_beside_no_certain_difference() -> None:
    """A table with +51 s (+27 to +76) must not stand below a headline that knows of no difference at all."""
    findings = replace(of_verdict("none"), p_value=0.062, below_rounding=[])
    late, early = (
        replace(findings.costs[0], name="time_at_speed", label="time at equal speed", before=Measured(size, 27.0, 76.0))
        for size in (51.0, 30.0)
    )
    text = summary(replace(findings, costs=[replace(late, floor=40.0)]))
    assert "(p = 0.062). Perhaps there is one: +51 s (+27 to +76) in time at equal speed." in text
    assert "Perhaps" not in summary(replace(findings, costs=[replace(early, floor=40.0)]))  # less than chance may give


@pytest.mark.parametrize("verdict", VERDICTS)
def test_words_are_those_of_the_trade_and_sentences_are_short(verdict: str) -> None:
    findings = of_verdict(verdict)
    for text in (words_of(page_of(verdict)), summary(findings)):
        for phrase in NOT_WORDS:
            assert phrase not in text, phrase
        lines = [
            line for line in text.splitlines() if "descentflow diagnose" not in line and "permutations" not in line
        ]
        for sentence in re.split(r"[.:;](?:\s|$)|\n", "\n".join(lines)):
            assert len(sentence.split()) <= 25, sentence


def test_the_terminal_says_what_the_page_says() -> None:
    findings = of_verdict("partial")
    assert summary(findings).splitlines()[0] == (
        "The simulator and the 400 real A20N flights differ (p = 0.0005): two causes explain a part of it. "
        "Which effect it is stays open: see the alternatives."
    )
    words = words_of(page_of("partial"))
    numbers = re.findall(r"[-+x]? ?[\d,.]*\d(?: %| s| NM| ft/min| kt)?", summary(findings))
    assert len(numbers) > 40
    assert [number for number in numbers if number.strip() not in words] == []


@pytest.mark.parametrize(
    "made", ["corrected.ckpt is the simulator", "corrected.parquet holds the flights of the simulator"]
)
def test_a_file_that_was_not_written_is_not_said_to_be_there(made: str) -> None:
    findings = replace(of_verdict("effect"), corrected_file=made.split()[0])
    line = f"{made} with these changes."
    assert f" {line}" not in summary(findings, written=False).replace(f"report.write(FOLDER) writes it: {line}", "")
    assert 'Next: report.write("gap"), then descentflow' in summary(findings, written=False)
    assert f" {line}" in summary(findings)
    assert "report.write" not in summary(findings) + page(findings)


def test_names_of_flights_never_become_markup() -> None:
    findings = of_verdict("unknown")
    flight = replace(findings.flights_worth_a_look[0], flight="<script>alert(1)</script>")
    assert "<script" not in page(replace(findings, flights_worth_a_look=[flight]))


@pytest.mark.parametrize("verdict", VERDICTS)
def test_names_of_simulators_and_causes_never_become_markup(verdict: str) -> None:
    """Sentences that the page shares with the terminal are escaped there, and are not here."""
    found, script = of_verdict(verdict), "<script>alert(1)</script>"
    causes = [replace(cause, label=script) for cause in found.causes]
    hostile = replace(found, details=replace(found.details, simulator=script), causes=causes)
    assert "<script" not in page(hostile)
    assert "&lt;script&gt;" in page(hostile)
    assert script in summary(hostile)


def test_the_next_command_can_be_typed_where_its_reader_is() -> None:
    partial = of_verdict("partial")
    assert next_command(partial, Path("there/gap"), "a.csv b.csv") == (
        "descentflow diagnose --real a.csv b.csv --simulator FLOWN_AGAIN --previous there/gap/gap.json "
        "--out there/gap-next"
    )
    trained = replace(partial, corrected_file="corrected.ckpt")
    sampled = "descentflow sample gap/corrected.ckpt -n 1000 --out samples.parquet"
    assert next_command(trained, "gap") == sampled
    assert sampled in words_of(page(trained, "gap"))
    assert next_command(of_verdict("unknown")).endswith("--catalogue MY_EFFECTS.py --out gap-next")
    assert next_command(of_verdict("none")) == ""


def test_a_share_of_all_flights_is_no_percentage() -> None:
    most = replace(finding_toys.brakes(), share_of_flights=ClosedShare(0.9991, 0.996, 1.0))
    (step,) = recipe_of([most], EFFECTS, (150.0, 350.0))
    assert step.text.endswith("FL190 to FL265, in nearly all flights")


LEVELS: list[float | None] = [157.5 + 15 * k for k in range(14)]
LONGEST = Curve(LEVELS, [300.0 + k for k in range(14)], [0.1] * 14, [3.0] * 14)
DRAWN: dict[str, Callable[[], Figure]] = {
    "time": lambda: cost_figure(finding_toys.costs(), "time"),
    "rate": lambda: cost_figure(finding_toys.costs(after=False), "rate"),
    "height": lambda: level_figure("height", LONGEST, finding_toys.details().profile),
    "lag": lambda: level_figure("lag", finding_toys.details().curves["rate"], finding_toys.details().profile),
}


@pytest.mark.parametrize("name", DRAWN)
def test_no_label_is_cut_or_over_another(name: str) -> None:
    figure = DRAWN[name]()
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    renderer = canvas.get_renderer()
    (axes,) = figure.axes
    texts = [t for t in figure.findobj(Text) if t.get_visible() and t.get_text().strip()]
    for axis in (axes.xaxis, axes.yaxis):
        # Ticks beyond the limits are there and not drawn.
        low, high = sorted(axis.get_view_interval())
        hidden = [tick.label1 for tick in axis.get_major_ticks() if not low <= tick.get_loc() <= high]
        texts = [t for t in texts if t not in hidden]
    boxes = [(t.get_text(), t.get_window_extent(renderer)) for t in texts]
    assert len(boxes) > 5
    for text, box in boxes:
        assert 0 <= box.x0 <= box.x1 <= figure.bbox.width, text
        assert 0 <= box.y0 <= box.y1 <= figure.bbox.height, text
    for (first, a), (second, b) in combinations(boxes, 2):
        # Half a pixel is rounding.
        apart = a.x1 <= b.x0 + 0.5 or b.x1 <= a.x0 + 0.5 or a.y1 <= b.y0 + 0.5 or b.y1 <= a.y0 + 0.5
        assert apart, f"{first!r} over {second!r}"


def test_what_is_not_known_is_left_out() -> None:
    """No rate compared, inputs in memory, no curve, no score, no limit."""
    findings = of_verdict("partial")
    bare = replace(findings.details, curves={}, detection_limits=[], singles=[], subsets=[], profile=[], lacks=[])
    causes = [replace(cause, takes_away={}) for cause in findings.causes]
    empty = replace(findings, costs=[], causes=causes, details=bare, provenance=Provenance(), where=[])
    assert "No rate of descent is compared, so times and distances are not known." in page(empty)
    assert "<figure" not in page(empty)
    assert "Next: " not in summary(empty)
    assert "Change in the simulator:" in summary(empty)


def test_no_limit_of_the_air_is_claimed_where_a_field_made_airspeeds() -> None:
    findings = of_verdict("none")
    sides = findings.provenance or Provenance()
    by_field = replace(findings, provenance=replace(sides, real=replace(sides.real, derived=3)))
    assert "ISA +1.2 K" in page(findings)
    assert "ISA +1.2 K" not in page(by_field)


def test_still_air_is_stated_apart_and_the_rest_is_said_in_seconds_and_feet() -> None:
    findings = finding_toys.findings()
    air = finding_toys.cause("temperature", {"deviation_k": ParameterEstimate(15.6, 14.0, 17.2, "K", "deviation")})
    size = ReportedSize("deviation_k", "ISA +15.6 K (+14 to +17.2)", "K", Measured(15.6))
    still = replace(air, of_air=True, sizes=[size])
    alone = replace(findings, verdict="effect", causes=[still], recipe=findings.recipe[:1])
    assert "differ (p = 0.0005): in their air, and in nothing else for certain." in summary(alone)
    assert "The air of these flights: ISA +15.6 K (+14 to +17.2). The simulator flies standard calm air." in summary(
        alone
    )
    text = summary(alone)
    assert "simulator: time at equal speed +1.5 s (before +25 s, by chance " in text
    assert "; rate of descent -8.0 ft/min (before -110 ft/min, by chance " in text
    assert "no effect of the catalogue explains what their air leaves of it" in summary(
        replace(alone, verdict="unknown")
    )
    both = replace(findings, verdict="effect", causes=[still, finding_toys.brakes()])
    assert "one cause and the air explain it." in summary(both)
    of_its_own = replace(still, on_both_sides=[OnBothSides("deviation_k", "K", 15.6, 5.0)])
    assert "standard calm air" not in summary(replace(alone, causes=[of_its_own]))
    assert "in all measured means" not in words_of(page(alone))


def test_what_is_left_within_chance_is_said_to_be_so_and_not_as_a_size() -> None:
    findings = finding_toys.findings()
    most = findings.remaining.largest
    middle = (most.level_low_fl + most.level_high_fl) / 2
    for error, said in (
        (abs(most.difference), "At no level is more left than chance gives."),
        (1e-6, "standard errors)"),
    ):
        curve = Curve([middle], before=[0.0], after=[most.difference], error=[error])
        details = replace(findings.details, curves={**findings.details.curves, most.quantity: curve})
        assert said in summary(replace(findings, details=details))
