"""One self-contained page of a study's scores."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from descentflow.reporting.pages import figure
from studies.blind_diagnosis.figures import blind_figures as figures
from studies.page_elements import Html, HtmlPage, code, marked, number, paragraph, percent, table

WORLDS = {"own": "our own world", "foreign": "JSBSim's aircraft"}


def write_page(scored: Mapping[str, Any], path: Path) -> None:
    """Write the page, whole or not at all.

    Args:
        scored: As :func:`studies.blind_diagnosis.blind_score.score` returns it.
        path: Of the HTML file.

    Raises:
        DataError: If the file's folder does not exist.

    Example:
        >>> from studies.blind_diagnosis.blind_draw import draw_plan
        >>> from studies.blind_diagnosis.blind_score import score
        >>> scored = score(draw_plan(20, seed=1), {"key_sha256": "00", "sealed_at": "today", "jobs": []}, {})
        >>> write_page(scored, Path("blind.html"))
        >>> "0 of 0 diagnoses of sealed sets were made" in Path("blind.html").read_text()
        True
    """
    blind_page(scored).write(path)


def blind_page(scored: Mapping[str, Any]) -> HtmlPage:
    """The page: goals first, then what was named for what was injected, sizes, closures and withheld effects.

    Args:
        scored: As :func:`studies.blind_diagnosis.blind_score.score` returns it.

    Example:
        >>> from studies.blind_diagnosis.blind_draw import draw_plan
        >>> from studies.blind_diagnosis.blind_score import score
        >>> scored = score(draw_plan(20, seed=1), {"key_sha256": "00", "sealed_at": "today", "jobs": []}, {})
        >>> "Goals, and what was reached" in blind_page(scored).render()
        True
    """
    page = HtmlPage("Effects hidden in flights, and what the diagnosis made of them", [_introduction(scored)])
    page.section("Goals, and what was reached", _goals(scored), *_misses(scored))
    for world, words in WORLDS.items():
        if scored["worlds"][world]["sets"]:
            _world(page, scored["worlds"][world], words)
    page.section("The same simulators given by their flights", *_same_verdicts(scored["same_verdicts"]))
    page.section("How long it takes", _slowest(scored["slowest"]))
    page.section("Each effect withheld from the catalogue, and put back", _withheld(scored["withheld"]))
    page.section("Simulators refitted to the flights", *_refit(scored["refit"]))
    return page


def _world(page: HtmlPage, scored: Mapping[str, Any], world: str) -> None:
    """Sections of one world."""
    confusion = figures.confusion_figure(scored["confusion"])
    what = f"What was named for what was planted in {world}"
    page.section(what, figure(confusion, f"Confusion matrices of planted and named, {world}"))
    page.section(f"False alarms in {world}", *_false_alarms(scored["false_alarms"]))
    strata = figures.strata_figure(scored["by_stratum"])
    page.section(f"By channels, size, flights and simulator: {world}", figure(strata, f"Shares found, {world}"))
    page.section(f"Cause by cause in {world}", _by_cause(scored["by_cause"]))
    page.section(f"A catalogued cause beside one outside, in {world}", _mixed(scored["mixed"]))
    page.section(f"Sizes in {world}", *_sizes(scored["sizes"]))
    closure = figures.closure_figure(scored["closure"])
    page.section(f"How far the gap closes in {world}", figure(closure, f"Claimed closures, {world}"), _of_true(scored))
    page.section(f"Where windows were found in {world}", *_windows(scored["windows"]))


def _introduction(scored: Mapping[str, Any]) -> Html:
    refused = len(scored["refused"])
    pace = ", ".join(f"{seconds:.0f} s for {n} flights" for n, seconds in scored["seconds"].items())
    return paragraph(
        f"{scored['diagnosed']} of {scored['jobs']} diagnoses of sealed sets were made"
        f"{f' ({refused} refused)' if refused else ''}. What they hide was written down and sealed on "
        f"{scored['sealed_at']} by the SHA-256 hash ",
        code(scored["key_sha256"]),
        ", before any was diagnosed; every diagnosis was hashed before the key was opened, and all hashes were checked "
        "before scoring. The flights are flown in time by the full equation of motion, or in six degrees of freedom by "
        "JSBSim, not by the equations that the diagnosis uses. "
        f"Shares are given with 95 % intervals. Processor time of a diagnosis: {pace}.",
        kind="lead",
    )


def _goals(scored: Mapping[str, Any]) -> Html:
    verdict = {True: marked("met", "good"), False: marked("missed", "bad"), None: "not judged"}
    rows = [[goal["goal"], goal["reached_text"], str(goal["n"]), verdict[goal["met"]]] for goal in scored["goals"]]
    return table(["goal", "reached", "sets", ""], rows, align="llrl")


def _misses(scored: Mapping[str, Any]) -> list[Html]:
    """Sets that miss each goal that is missed."""
    missed = [goal for goal in scored["goals"] if goal["met"] is False]
    return [paragraph(f"{goal['goal']}: missed by {', '.join(goal['misses']) or 'the whole'}.") for goal in missed]


def _same_verdicts(same: Mapping[str, Any]) -> list[Html]:
    rows = [[row["set"], ", ".join(row["checkpoint"]), ", ".join(row["flights"])] for row in same["differing"]]
    text = (
        f"{_share(same)} of the sets got the same verdict and causes from a simulator's flights as from its checkpoint."
    )
    return [paragraph(text), table(["set", "by checkpoint", "by flights"], rows, align="lll")]


def _slowest(rows: Sequence[Mapping[str, Any]]) -> Html:
    cells = [[r["job"], ", ".join(r["causes"]) or "none", str(r["flights"]), f"{r['seconds']:.1f} s"] for r in rows]
    return table(["slowest diagnoses", "planted", "flights", "processor time"], cells, align="llrr")


def _mixed(rows: Sequence[Mapping[str, Any]]) -> Html:
    cells = [
        [
            r["job"],
            r["catalogued"],
            r["outside"],
            r["verdict"],
            "yes" if r["named"] else "no",
            "yes" if r["rest"] else "no",
        ]
        for r in rows
    ]
    return table(["set", "catalogued", "outside", "verdict", "named", "the rest is told"], cells, align="llllll")


def _of_true(scored: Mapping[str, Any]) -> Html:
    cells = [
        [
            r["set"],
            ", ".join(r["causes"]),
            number(r["before"]),
            number(r["after"]),
            number(r["true"]),
            percent(r["of_true"]),
        ]
        for r in scored["of_true"]
    ]
    head = ["set", "planted", "before", "corrected", "true effect", "of what the true effect closes"]
    return table(head, cells, align="llrrrr")


def _false_alarms(alarms: Mapping[str, Any]) -> list[Html]:
    named = "; ".join(", ".join(names) for names in alarms["named"]) or "none"
    text = f"{_share(alarms)} of the sets without an effect raised an alarm. What was named: {named}."
    return [paragraph(text), figure(figures.p_value_figure(alarms), "Distribution of p-values")]


def _by_cause(rows: Sequence[Mapping[str, Any]]) -> Html:
    measures = ("detected", "first", "in_group", "unknown")
    cells = [
        [
            r["cause"],
            r["channels"],
            r["size"],
            str(r["n"]),
            *(_share(r[measure], interval=False) for measure in measures),
        ]
        for r in rows
    ]
    head = ["injected", "channels", "size", "sets", "detected", "right first", "in the group", "unknown"]
    return table(head, cells, align="lllr", grouped=True)


def _sizes(sizes: Mapping[str, Any]) -> list[Html]:
    cells = [
        [r["cause"], r["parameter"], percent(r["bias"]), percent(r["spread"]), _share(r["coverage"])]
        for r in sizes["rows"]
    ]
    text = f"90 % intervals cover the injected size in {_share(sizes['coverage'])} of all estimates."
    head = ["effect", "parameter", "median error", "quartile range", "covered"]
    drawn = figure(figures.sizes_figure(sizes["estimates"]), "Estimated and injected sizes")
    return [paragraph(text), drawn, table(head, cells, align="llr", grouped=True)]


def _windows(rows: Sequence[Mapping[str, Any]]) -> list[Html]:
    named = [row["overlap"] for row in rows if row["overlap"] is not None]
    places = [row["cell_in"] for row in rows if row["cell_in"] is not None]
    text = f"{len(named)} of {len(rows)} windows of speed brakes were named"
    if named:
        text += f"; they overlap the injected ones by {percent(sum(named) / len(named))} of their union on average"
    if places:
        text += f"; {sum(places)} of {len(places)} times the rate differs most where the window is"
    return [paragraph(f"{text}."), figure(figures.windows_figure(rows), "Injected windows and those found")]


def _withheld(rows: Sequence[Mapping[str, Any]]) -> Html:
    cells = []
    for row in rows:
        without, put_back = row["without"], row["with"]
        cells.append(
            [
                row["effect"],
                _mark(_answer(without), row["right_without"]),
                _where(without["where"]),
                _mark(_answer(put_back), row["right_with"]),
                _before_and_after(put_back),
                percent((row["closing"] or {}).get("of_true")),
            ]
        )
    head = ["injected", "without it: verdict", "where it lies", "with it: verdict", "gap, before and after"]
    return table([*head, "of the true closure"], cells, align="lllllr")


def _before_and_after(brief: Mapping[str, Any]) -> str:
    ends = f"{number(brief['gap_before'])} to {number(brief['gap_after'])}"
    return f"{ends} (floor {number(brief['floor'])})"


def _refit(rows: Sequence[Mapping[str, Any]]) -> list[Html]:
    text = "The simulator learnt from other flights with the same effect: its drag has taken up what it can."
    cells = [[r["effect"], _mark(_answer(r), r["right_first"]), number(r["p_value"])] for r in rows]
    return [paragraph(text), table(["injected in both", "verdict", "p-value"], cells, align="llr")]


def _answer(brief: Mapping[str, Any]) -> str:
    named = "; ".join(
        name if len(group) == 1 else f"{name} (or {', '.join(g for g in group if g != name)})"
        for name, group in zip(brief["named"], brief["groups"], strict=True)
    )
    return f"{brief['verdict']}{': ' + named if named else ''}"


def _where(cell: Mapping[str, Any] | None) -> str:
    if cell is None:
        return ""
    levels = f"FL{cell['level_low_fl']:.0f}-{cell['level_high_fl']:.0f}" if cell.get("level_low_fl") is not None else ""
    return f"{cell['quantity']} {levels}, {number(cell.get('distance'))} {cell.get('unit') or ''}"


def _mark(text: str, right: bool) -> Html:
    return marked(text, "good" if right else "bad")


def _share(one: Mapping[str, Any], *, interval: bool = True) -> str:
    if one["share"] is None:
        return "-"
    ends = f" ({percent(one['low'])} to {percent(one['high'])}, n = {one['n']})" if interval else ""
    return f"{percent(one['share'])}{ends}"
