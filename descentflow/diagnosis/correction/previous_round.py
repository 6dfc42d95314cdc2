"""The loop closed: what an earlier diagnosis predicted, compared with what the changed simulator does."""

from pathlib import Path

from descentflow.core.errors import DataError
from descentflow.diagnosis.correction.measured_gap import again, mean_of
from descentflow.diagnosis.findings.cause_found import Cause, ClosedShare
from descentflow.diagnosis.findings.correction_found import Previous
from descentflow.diagnosis.findings.findings import Findings
from descentflow.diagnosis.findings.inputs_found import Provenance
from descentflow.diagnosis.findings.plain_values import percent
from descentflow.diagnosis.findings.read_gap import read_gap
from descentflow.diagnosis.inference.two_sides import Compared

NINETY = 1.645
"""Standard errors on either side of a 90 % interval."""
MIN_SHARE = 0.5
"""Of the earlier round's entries that must be measured again: of fewer, the two gaps are not of the same."""
MIN_EXCESS = 1.02
"""Gap, in noise floors, below which there was none to close."""


def previous_round(path: str | Path, made: Provenance, typecode: str) -> Findings:
    """Read an earlier report and check that it is of the same flights.

    Args:
        path: Its `gap.json`.
        made: What is diagnosed now.
        typecode: Type whose coefficients are taken now.

    Raises:
        DataError: If it cannot be read, or it is of another version, other real flights, another type, or of the very
            same flights of the simulator.

    Example:
        >>> from descentflow.diagnosis.diagnose import diagnose
        >>> from descentflow.effects import EFFECTS
        >>> only = {"mass": EFFECTS["mass"]}
        >>> report = diagnose("descents.parquet", "A320", catalogue=only, out="first")
        >>> previous_round("first/gap.json", report.provenance, "A320").verdict
        'effect'
    """
    found = read_gap(path)
    then = found.provenance
    if then is None:
        raise DataError(
            f"{path} describes no flights",
            expected="the gap.json of a diagnosis of the same real flights",
            mend="diagnose the earlier simulator again with this version of descentflow",
        )
    _same(path, "descentflow", then.versions.get("descentflow"), made.versions.get("descentflow"), "version")
    _same(path, "signatures", found.details.typecode, typecode, "aircraft type")
    _same(path, "real flights", then.real.fingerprint, made.real.fingerprint, "real flights", named=then.real.name)
    own = made.simulator.fingerprint
    if own is not None and own == then.simulator.fingerprint:
        raise DataError(
            f"{path} is of the very flights of the simulator that are diagnosed now ({then.simulator.name})",
            expected="flights of the simulator after it was changed",
            mend="put the causes into the simulator, fly it again and pass those flights",
        )
    if not found.details.measured_over:
        raise DataError(
            f"{path} does not say what its gap was measured over",
            expected="a diagnosis against flights of a simulator or its checkpoint",
            mend="diagnose the earlier simulator again with this version of descentflow",
        )
    return found


def _same(path: str | Path, what: str, then: object, now: object, kind: str, named: str = "") -> None:
    if then != now:
        shown = f"other {kind} ({named})" if named else f"{what} of {kind} {then}, and {now} now"
        raise DataError(
            f"{path}: {shown}",
            expected=f"the same {kind} in both rounds",
            mend="diagnose the earlier simulator again with the flights, the type and the version of now",
        )


def held_against(previous: Findings, name: str, compared: Compared, now: Findings, seed: int) -> Previous:
    """Predicted and achieved closure, what remains and what is next.

    Achieved is 1 - (gap now - floor now) / (gap then - floor then), over the entries that the earlier gap was measured
    over and in its spreads; its interval takes the errors of both gaps as independent, which is wide: the real flights
    are the same.

    Args:
        previous: The earlier round.
        name: Of its file.
        compared: Flights of both sides now.
        now: What was found now.
        seed: Of permutations and fleets.

    Raises:
        DataError: If less than half of what it measured is measured now.

    Example:
        >>> from dataclasses import replace
        >>> from descentflow.diagnosis.correction.measured_gap import measured_gap
        >>> from descentflow.diagnosis.diagnose import diagnose
        >>> from descentflow.diagnosis.inference.example_sides import example_sides
        >>> from descentflow.effects import EFFECTS
        >>> report = diagnose("descents.parquet", "A320", catalogue={"mass": EFFECTS["mass"]})
        >>> warm, same = example_sides(EFFECTS["temperature"], [10.0]), example_sides()
        >>> then = measured_gap(warm, warm.of("tas"), seed=0)
        >>> details = replace(report.details, measured_over=then.entries, gap_error=then.error)
        >>> found = held_against(replace(report, details=details), "gap.json", same, report, seed=0)
        >>> found.achieved.estimate > 0.9
        True
    """
    gap, kept = again(compared, previous.details.measured_over, seed)
    if len(kept) < MIN_SHARE * len(previous.details.measured_over):
        raise DataError(
            f"{len(kept)} of the {len(previous.details.measured_over)} bands and quantities of {name} are measured now",
            expected=f"at least {100 * MIN_SHARE:.0f} % of them: the same levels and channels in both rounds",
            mend="fly the same levels, and give the channels that the earlier flights had",
        )
    before, floor = mean_of(kept)
    predicted = previous.causes[0].closure.marginal if previous.causes else ClosedShare(None, None, None)
    achieved = _achieved(before, floor, previous.details.gap_error or 0.0, gap.gap, gap.floor, gap.error)
    text = " ".join([_judged(previous, predicted, achieved), _remains(now), _next(previous, now)])
    names = [cause.effect for cause in previous.causes]
    return Previous(name, names, predicted, achieved, before, gap.gap, text)


def _achieved(before: float, floor: float, error: float, now: float, floor_now: float, error_now: float) -> ClosedShare:
    """Closed share with a 90 % interval by the delta method."""
    if before <= floor * MIN_EXCESS:
        return ClosedShare(None, None, None)
    width = before - floor
    share = 1 - (now - floor_now) / width
    spread = (error_now**2 + ((1 - share) * error) ** 2) ** 0.5 / width
    return ClosedShare(share, share - NINETY * spread, share + NINETY * spread)


def _judged(previous: Findings, predicted: ClosedShare, achieved: ClosedShare) -> str:
    names = " and ".join(cause.label or cause.effect for cause in previous.causes)
    if achieved.estimate is None:
        return "There was no gap to close."
    if predicted.estimate is None:
        return f"No closure was predicted; {achieved} of the gap is closed now."
    told = f"With {names} in the simulator {predicted} was to close; {achieved} of the gap is closed"
    low, high = predicted.low, predicted.high
    if low is None or high is None or achieved.low is None or achieved.high is None:
        return f"{told}."
    if achieved.high < low:
        return f"{told}: less than predicted."
    return f"{told}: more than predicted." if achieved.low > high else f"{told}: as predicted."


def _remains(now: Findings) -> str:
    if now.verdict == "none":
        return f"What remains is what {'rounding' if now.is_small else 'chance'} would show."
    left = f"A gap remains (p = {now.p_value:.2g})"
    if not now.causes:
        return f"{left}, of no named cause."
    named = " and ".join(cause.text or cause.effect for cause in now.causes)
    return f"{left}: {named}{', and more of no named cause' if now.verdict == 'partial' else ''}."


def _next(previous: Findings, now: Findings) -> str:
    if now.verdict == "none":
        return "Nothing is left to add."
    if not now.causes:
        return "Next: look at the levels and flights where it lies; the cause is not in the catalogue."
    earlier = {cause.effect: cause for cause in previous.causes}
    return " ".join(_step(cause, step.text, earlier) for cause, step in zip(now.causes, now.recipe, strict=True))


def _step(cause: Cause, recipe: str, earlier: dict[str, Cause]) -> str:
    if cause.effect in earlier:
        closed = percent(None if cause.own_closure is None else cause.own_closure.estimate)
        name = cause.label or cause.effect
        change = recipe.removeprefix(f"{name} ")
        # Nothing tells a cause that was not entered from one that was entered with another size.
        return f"Next: change what was entered for {name}, or enter it if it was not: {change} (closes {closed})."
    return f"Next: {recipe}."
