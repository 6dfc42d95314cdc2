"""The loop closed: what an earlier diagnosis predicted, compared with what the changed simulator does."""

from pathlib import Path

from descentflow.core.errors import DataError
from descentflow.diagnosis.findings.cause_found import ClosedShare
from descentflow.diagnosis.findings.correction_found import Previous
from descentflow.diagnosis.findings.costs_found import NINETY
from descentflow.diagnosis.findings.findings import Findings
from descentflow.diagnosis.findings.inputs_found import Provenance
from descentflow.diagnosis.findings.read_gap import read_gap
from descentflow.diagnosis.gap._labellings import mean_over_quantities
from descentflow.diagnosis.gap._measured_gap import MeasuredGap, closed_share, measured_again
from descentflow.diagnosis.sides.vectors import Vectors

MIN_SHARE_AGAIN = 0.5
"""Share of the earlier round's entries that must be measured again: of fewer, the two gaps are not of the same."""


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
    earlier = read_gap(path)
    then = earlier.provenance
    if not then.real.flights:
        raise DataError(
            f"{path} describes no flights",
            expected="the gap.json of a diagnosis of the same real flights",
            mend="diagnose the earlier simulator again with this version of descentflow",
        )
    _same(path, "descentflow", then.versions.get("descentflow"), made.versions.get("descentflow"), "version")
    _same(path, "signatures", earlier.details.typecode, typecode, "aircraft type")
    _same(path, "real flights", then.real.fingerprint, made.real.fingerprint, "real flights", named=then.real.name)
    own = made.simulator.fingerprint
    if own is not None and own == then.simulator.fingerprint:
        raise DataError(
            f"{path} is of the very flights of the simulator that are diagnosed now ({then.simulator.name})",
            expected="flights of the simulator after it was changed",
            mend="put the causes into the simulator, fly it again and pass those flights",
        )
    if not earlier.details.measured_over:
        raise DataError(
            f"{path} does not say what its gap was measured over",
            expected="a diagnosis against flights of a simulator or its checkpoint",
            mend="diagnose the earlier simulator again with this version of descentflow",
        )
    return earlier


def _same(path: str | Path, what: str, then: object, now: object, kind: str, named: str = "") -> None:
    if then != now:
        shown = f"other {kind} ({named})" if named else f"{what} of {kind} {then}, and {now} now"
        raise DataError(
            f"{path}: {shown}",
            expected=f"the same {kind} in both rounds",
            mend="diagnose the earlier simulator again with the flights, the type and the version of now",
        )


def held_against(previous: Findings, name: str, compared: Vectors, seed: int) -> Previous:
    """Predicted and achieved closure.

    Achieved is the closed share of the gap then, over the entries that it was measured over and in its spreads; its
    interval takes the errors of both gaps as independent, which is wide: the real flights are the same.

    Args:
        previous: The earlier round.
        name: Of its file.
        compared: Flights of both sides now.
        seed: Of permutations and groups of aircraft.

    Raises:
        DataError: If less than half of what it measured is measured now.
    """
    then = previous.details
    chosen, spreads, *earlier = measured_again(compared, then.measured_over)
    if (kept := int(chosen.sum())) < MIN_SHARE_AGAIN * len(then.measured_over):
        raise DataError(
            f"{kept} of the {len(then.measured_over)} bands and quantities of {name} are measured now",
            expected=f"at least {100 * MIN_SHARE_AGAIN:.0f} % of them: the same levels and channels in both rounds",
            mend="fly the same levels, and give the channels that the earlier flights had",
        )
    now = MeasuredGap(compared, chosen, seed, spreads)
    before, floor = (float(mean_over_quantities(compared, values, chosen)) for values in earlier)
    achieved = achieved_share(before, floor, then.gap_error or 0.0, now.before, now.floor(compared.y), now.error)
    predicted = previous.causes[0].closure.marginal if previous.causes else ClosedShare(None, None, None)
    return Previous(name, [cause.effect for cause in previous.causes], predicted, achieved, before, now.before)


def achieved_share(
    before: float, floor: float, error: float, now: float, floor_now: float, error_now: float
) -> ClosedShare:
    """Closed share of a gap then and now with a 90 % interval by the delta method.

    Example:
        >>> print(achieved_share(1.0, 0.1, 0.05, 0.3, 0.1, 0.04))
        78 % (70 % to 85 %)
    """
    share = closed_share(before, floor, now, floor_now)
    if share is None:
        return ClosedShare(None, None, None)
    half = NINETY * (error_now**2 + ((1 - share) * error) ** 2) ** 0.5 / (before - floor)
    return ClosedShare(share, share - half, share + half)
