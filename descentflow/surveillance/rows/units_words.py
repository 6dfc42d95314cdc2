"""Messages about columns that contradict each other: what was got, what is expected, and the factor that mends it."""

from collections.abc import Iterable, Sequence

import numpy as np

from descentflow.core.errors import DataError
from descentflow.surveillance.rows.rate_readings import AS_GIVEN, OPPOSITE
from descentflow.surveillance.rows.readings import Solution

EXPECTED = {
    "altitude": "altitude in ft",
    "IAS": "indicated airspeed in kt",
    "Mach": "Mach as 0.78",
    "TAS": "TAS in kt",
    "groundspeed": "groundspeed in kt",
    "vertical_rate": "vertical_rate in ft/min, negative in descent",
}
LEVEL_FT = 100.0
OTHER_QUANTITY = {
    "IAS": "take the indicated airspeed of BDS 6,0; where there is none, compute CAS from Mach and altitude",
    "TAS": "take the true airspeed, or leave the column out",
    "groundspeed": "take the groundspeed, or leave the column out",
}


def refusal(source: str, given: Solution, best: Sequence[Solution]) -> DataError:
    """The error where other readings make all columns agree.

    Args:
        source: Begin of the message.
        given: How columns agree as they are.
        best: The readings, several if they do equally well.

    Example:
        >>> from descentflow.surveillance.rows.readings import READINGS
        >>> found = Solution({"IAS": READINGS["IAS"][1]}, {}, {"IAS and Mach": 0.002})
        >>> print(refusal("rows.csv", Solution({}, {"IAS and Mach": 11.0}, {"IAS and Mach": 0.66}), [found]))
        rows.csv: IAS seems to be in m/s; read so, all columns agree (IAS and Mach within 0.2%); as given, IAS and ...
    """
    # Of several readings, what is common is said once.
    names = list(dict.fromkeys(name for one in best for name in one.changed))
    agreement = _agreement(best[0].differences)
    so = f"read so, all columns agree ({agreement})" if agreement else "airliners can fly so"
    return DataError(
        f"{source}: {' or '.join(map(readings_in_words, best))}; {so}; {_as_given(given)}",
        expected=_expected(names),
        mend=" or, if it is that, ".join(map(_mend, best)),
    )


def contradiction(source: str, given: Solution, best: Sequence[Solution]) -> DataError:
    """The error where no reading makes all columns agree.

    Args:
        source: Begin of the message.
        given: How columns agree as they are.
        best: Readings in which the others agree without one of them, several if it may be one or another.

    Example:
        >>> given = Solution({}, {"IAS and Mach": 2.0}, {"IAS and Mach": 0.12})
        >>> print(contradiction("rows.csv", given, []))
        rows.csv: columns contradict each other: IAS and Mach differ by 13%, in units of any kind; expected ...
    """
    wrong = [name for name, misfit in given.misfits.items() if misfit > 1]
    differing = ", ".join(_differ(name, given.differences[name]) for name in wrong) or "airliners do not fly so"
    names = list(dict.fromkeys(part for pair in wrong for part in pair.split(" and ") if part in EXPECTED))
    if len(best) == 1:
        column, *more = [name for name, reading in best[0].readings.items() if reading.off]
        rest = _agreement(best[0].differences)
        got = f"{' and '.join([column, *more])} contradicts the other columns: {differing}, in units of any kind"
        got += f", while the others agree ({rest})" if rest else ""
        return DataError(
            f"{source}: {got}",
            expected=_expected([column, *more]),
            mend=f"find out what the column {column} holds, and correct it or leave it out of the table",
        )
    return DataError(
        f"{source}: columns contradict each other: {differing}, in units of any kind",
        expected=f"{_expected(names)}, of the same rows",
        mend=f"find out which of {', '.join(names)} is wrong, and correct it or leave it out of the table",
    )


def _swapped(one: Solution) -> bool:
    meanings = {name: one.changed[name].meaning for name in ("IAS", "TAS") if name in one.changed}
    return meanings == {"IAS": "TAS", "TAS": "IAS"}


def readings_in_words(one: Solution) -> str:
    """The unit or quantity that each column seems to have.

    Example:
        >>> from descentflow.surveillance.rows.readings import READINGS
        >>> readings_in_words(Solution({"IAS": READINGS["IAS"][1]}))
        'IAS seems to be in m/s'
    """
    if _swapped(one):
        return "IAS and TAS seem to be swapped"
    first, *others = one.changed.items()
    if first[0] == "vertical_rate" and first[1].words.startswith("with the sign"):
        return "vertical_rate has the sign of a sink rate: it is positive where the altitude falls"
    seems = f"{first[0]} seems to be {first[1].words}"
    return " and ".join([seems, *(f"{name} {reading.words}" for name, reading in others)])


def _mend(one: Solution) -> str:
    said = []
    if factors := {name: f"{reading.factor:.5g}" for name, reading in one.changed.items() if reading.factor != 1}:
        columns = " and ".join(f"{name} by {factor}" for name, factor in factors.items())
        options = " ".join(f"--column '{name}={name}*{factor}'" for name, factor in factors.items())
        said.append(
            f"multiply the column{'s' * (len(factors) > 1)} {columns} before passing the rows, or let `prepare` do"
        )
        said[-1] += f" it ({options}, with the table's own name behind the sign =)"
    if one.readings.get("altitude", AS_GIVEN).factor == LEVEL_FT:
        said.append("or say that it holds flight levels (--column FL=NAME)")
    if _swapped(one):
        return ", ".join([*said, "swap them, or let `prepare` do it (--column IAS=TAS --column TAS=IAS)"])
    for name, reading in one.changed.items():
        if reading.meaning == "unsigned":
            said.append("give the rates of descents a minus")
        elif reading.meaning:
            said.append(OTHER_QUANTITY[name])
    return ", ".join(said)


def _expected(names: Iterable[str]) -> str:
    said = [EXPECTED[name] for name in names]
    return " and ".join(filter(None, [", ".join(said[:-1]), said[-1]])) if said else "columns that agree"


def _agreement(differences: dict[str, float]) -> str:
    return ", ".join(f"{pair} within {np.expm1(abs(found)):.1%}" for pair, found in differences.items())


def _as_given(given: Solution) -> str:
    wrong = [pair for pair, misfit in given.misfits.items() if misfit > 1]
    if not wrong:
        return "as given, airliners do not fly so"
    worst = max(wrong, key=lambda pair: given.misfits[pair])
    return f"as given, {_differ(worst, given.differences[worst])}"


def _differ(pair: str, difference: float) -> str:
    if abs(difference) >= OPPOSITE:
        return f"{pair} have opposite signs"
    if abs(difference) > 0.7:
        return f"{pair} differ by a factor of {np.exp(min(abs(difference), 20.0)):.3g}"
    return f"{pair} differ by {np.expm1(abs(difference)):.0%}"
