"""Messages about columns that contradict each other: what was got, what is expected, and the factor that mends it."""

from collections.abc import Iterable, Sequence

import numpy as np

from descentflow.core.errors import DataError
from descentflow.surveillance.rows._readings import OPPOSITE, SINKS, Reading, Solution

EXPECTED = {
    "altitude": "altitude in ft",
    "IAS": "indicated airspeed in kt",
    "Mach": "Mach as 0.78",
    "TAS": "TAS in kt",
    "groundspeed": "groundspeed in kt",
    "vertical_rate": "vertical_rate in ft/min, negative in descent",
}
OTHER_QUANTITY = {
    "IAS": "take the indicated airspeed of BDS 6,0; where there is none, compute CAS from Mach and altitude",
    "TAS": "take the true airspeed, or leave the column out",
    "groundspeed": "take the groundspeed, or leave the column out",
    "vertical_rate": "give the rates of descents a minus",
}
SWAPPED = {"IAS": "TAS", "TAS": "IAS"}
"""Meaning of both, where they stand for each other."""


def refusal(source: str, given: Solution, best: Sequence[Solution]) -> DataError:
    """The error where other readings make all columns agree."""
    agreement = _agreement(best[0])
    so = f"read so, all columns agree ({agreement})" if agreement else "airliners can fly so"
    worst = max(given.wrong, key=lambda pair: given.misfits[pair], default="")
    differ = _differ(given, worst) if worst else "airliners do not fly so"
    return DataError(
        f"{source}: {' or '.join(map(readings_in_words, best))}; {so}; as given, {differ}",
        expected=_expected(name for reading in best for name in reading.changed),
        mend=" or, if it is that, ".join(map(_mend, best)),
    )


def contradiction(source: str, given: Solution, best: Sequence[Solution]) -> DataError:
    """The error where no reading makes all columns agree."""
    differing = ", ".join(_differ(given, pair) for pair in given.wrong) or "airliners do not fly so"
    names = list(dict.fromkeys(part for pair in given.wrong for part in pair.split(" and ") if part in EXPECTED))
    got, expected = f"columns contradict each other: {differing}", f"{_expected(names)}, of the same rows"
    mend, rest = f"find out which of {', '.join(names)} is wrong", ""
    if len(best) == 1:
        off, rest = best[0].off, _agreement(best[0])
        got, expected = f"{' and '.join(off)} contradicts the other columns: {differing}", _expected(off)
        mend = f"find out what the column {off[0]} holds"
    others = f", while the others agree ({rest})" if rest else ""
    return DataError(
        f"{source}: {got}, in units of any kind{others}",
        expected=expected,
        mend=f"{mend}, and correct it or leave it out of the table",
    )


def scaled_by_hundred(source: str, name: str, factor: float, outside: int, values: int) -> DataError:
    """The error where a column's values are possible but for a factor of a hundred."""
    scaled = Reading(f"{'multiplied' if factor < 1 else 'divided'} by 100", factor)
    return DataError(
        f"{source}: {name} seems to be {scaled.words}: {outside:,} of {values:,} values are impossible as given",
        expected=EXPECTED[name],
        mend=_mend(Solution({name: scaled})),
    )


def readings_in_words(one: Solution) -> str:
    """The unit or quantity that each column seems to have."""
    if _swapped(one):
        return "IAS and TAS seem to be swapped"
    (first, reading), *others = one.changed.items()
    if reading.words == SINKS:
        return "vertical_rate has the sign of a sink rate: it is positive where the altitude falls"
    return " and ".join([f"{first} seems to be {reading.words}", *(f"{name} {other.words}" for name, other in others)])


def _swapped(one: Solution) -> bool:
    return {name: one.changed[name].meaning for name in SWAPPED if name in one.changed} == SWAPPED


def _mend(one: Solution) -> str:
    mends = []
    if factors := {name: f"{reading.factor:.5g}" for name, reading in one.changed.items() if reading.factor != 1}:
        columns = " and ".join(f"{name} by {factor}" for name, factor in factors.items())
        options = " ".join(f"--column '{name}={name}*{factor}'" for name, factor in factors.items())
        mends.append(
            f"multiply the column{'s' * (len(factors) > 1)} {columns} before passing the rows, or let `prepare` do it "
            f"({options}, with the table's own name behind the sign =)"
        )
    if factors.get("altitude") == "100":
        mends.append("or say that it holds flight levels (--column FL=NAME)")
    if _swapped(one):
        return ", ".join([*mends, "swap them, or let `prepare` do it (--column IAS=TAS --column TAS=IAS)"])
    return ", ".join([*mends, *(OTHER_QUANTITY[name] for name, reading in one.changed.items() if reading.meaning)])


def _expected(names: Iterable[str]) -> str:
    *others, last = [EXPECTED[name] for name in dict.fromkeys(names)] or ["columns that agree"]
    return " and ".join(filter(None, [", ".join(others), last]))


def _agreement(one: Solution) -> str:
    return ", ".join(f"{pair} within {np.expm1(abs(difference)):.1%}" for pair, (difference, _) in one.pairs.items())


def _differ(one: Solution, pair: str) -> str:
    difference = abs(one.pairs[pair][0])
    if difference >= OPPOSITE:
        return f"{pair} have opposite signs"
    if difference > 0.7:
        return f"{pair} differ by a factor of {np.exp(min(difference, 20.0)):.3g}"
    return f"{pair} differ by {np.expm1(difference):.0%}"
