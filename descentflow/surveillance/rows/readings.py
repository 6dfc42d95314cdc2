"""Units and meanings of columns, and the reading in which all columns agree with each other."""

import itertools
from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np
import polars as pl
from numpy.typing import NDArray

from descentflow.core.units import FT_M, KT_MPS
from descentflow.surveillance.rows.air_data import Array, cas_of_mach_kt, isa_tas_of_mach_kt, mach_of_cas
from descentflow.surveillance.rows.rate_readings import AS_GIVEN, OFF, OPPOSITE, RATE_READINGS, Reading, Steps
from descentflow.surveillance.rows.schema import POSSIBLE

MIN_VALUES = 20
"""Rows below which nothing is checked."""
MIN_AIRCRAFT = 3
"""Aircraft below which groundspeed is not compared: one in 160 kt of headwind looks as if it were in m/s; and below
which a column that no unit explains is a warning: a register of one aircraft may be broken."""
SAMPLE = 20_000
"""Rows that are compared."""
RATE_SAMPLE = 200_000
"""First rows of a file whose rates are compared: differences need neighbours."""
AGREES = 0.06
"""Median relative difference of IAS and the CAS of Mach below which they agree; real sources have 0.002 to 0.023."""
AIR = 0.10
"""The same of TAS and the TAS of Mach in standard air: air 50 K hotter makes it; real sources have 0.004 to 0.027."""
BOTH = 0.12
"""The same of TAS and IAS, where there is no Mach between them."""
WIND = 0.15
"""The same of an IAS that is a TAS or a groundspeed: half of the aircraft have less wind along their track."""
WINDS = 0.25
"""Median of a groundspeed over TAS, as a logarithm: winds of all tracks nearly cancel; 0.16 in a jet of 210 kt."""
SHORT_FT = 3000.0
"""Altitude below which TAS and groundspeed are not compared."""
HIGH_FT, SLOWEST_KT, FASTEST_MACH = 28_000.0, 145.0, 0.98
"""Above this altitude most rows of airliners and business aircraft have more CAS and less Mach: a PC12 flies
some 150 kt at its ceiling, and 270 kt in m/s are 139."""
LOWEST_TOP_FT, TAXI_KT = 700.0, 150.0
"""Rows of which none is above this, at more than this speed, are of flight levels that are taken for feet."""
LOWEST_READ_FT = 10_000.0
"""Rows whose altitude is read in another unit reach this: what is below has no descents."""
EARNED = 0.5
"""Spread of a column about its own quantity, over that about another one, below which it is not the other one: the
ratio of TAS and IAS changes with altitude, a factor does not."""
CLOSELY = 0.55
"""Share of the allowed difference that another unit leaves where columns contradict each other as given, at most."""

SPEEDS = (Reading("in m/s", 1 / KT_MPS), Reading("in km/h", 1 / 1.852), Reading("in miles per hour", 1 / 1.15078))
READINGS: dict[str, tuple[Reading, ...]] = {
    "altitude": (AS_GIVEN, Reading("in metres", 1 / FT_M), Reading("in hundreds of feet", 100.0)),
    "IAS": (AS_GIVEN, *SPEEDS, Reading("TAS or groundspeed", meaning="TAS"), OFF),
    "Mach": (AS_GIVEN, Reading("in hundredths", 0.01), Reading("in thousandths", 0.001), OFF),
    "TAS": (AS_GIVEN, *SPEEDS, Reading("IAS", meaning="IAS"), OFF),
    "groundspeed": (AS_GIVEN, *SPEEDS, Reading("IAS", meaning="IAS"), OFF),
    "vertical_rate": RATE_READINGS,
}
"""Column -> how it may be read, the expected way first."""


@dataclass(frozen=True)
class Evidence:
    """Columns of the same rows, as given; (n,) each, NaN where missing.

    Attributes:
        columns: `altitude`, `IAS`, and those of `Mach`, `TAS` and `groundspeed` that the source gives.
        steps: What altitude does between neighbours, and the rate that is reported there.

    Example:
        >>> Evidence({"altitude": np.full(30, 35e3), "IAS": np.full(30, 266.0)}).given
        ('altitude', 'IAS')
    """

    columns: dict[str, Array]
    steps: Steps | None = None

    @classmethod
    def of(cls, rows: pl.DataFrame) -> "Evidence | None":
        """Columns that can be compared, of a sample of rows; none if these are too few.

        Example:
            >>> Evidence.of(pl.read_parquet("rows.parquet")).given
            ('altitude', 'IAS', 'Mach', 'TAS', 'groundspeed', 'vertical_rate')
        """
        names = [name for name in ("altitude", "IAS", "Mach", "TAS", "groundspeed") if name in rows.columns]
        if rows["icao24"].n_unique() < MIN_AIRCRAFT:
            names = [name for name in names if name != "groundspeed"]
        usable = rows.select(names).drop_nulls([name for name in names if name in ("altitude", "IAS", "Mach")])
        usable = usable.filter(
            pl.col("altitude").is_between(*POSSIBLE["altitude"]) & pl.col("IAS").is_between(1.0, 1000.0)
        )
        if "Mach" in names:
            flying = usable.filter(pl.col("Mach").is_between(0.2, 1.0))
            usable = flying if len(flying) >= MIN_VALUES else usable.filter(pl.col("Mach").is_between(0.2, 1000.0))
        if len(usable) < MIN_VALUES:
            return None
        usable = usable.gather_every(max(len(usable) // SAMPLE, 1))
        columns: dict[str, Array] = {
            name: usable[name].cast(pl.Float64).to_numpy() for name in names if usable[name].count() >= MIN_VALUES
        }
        if "TAS" in columns:  # what stands for no value (9999, 0) is no evidence of a unit
            columns["TAS"] = np.where((columns["TAS"] > 0) & (columns["TAS"] < 2000), columns["TAS"], np.nan)
        return cls(columns, Steps.of(rows.head(RATE_SAMPLE)))

    @property
    def given(self) -> tuple[str, ...]:
        """Columns that are compared."""
        return (*self.columns, *(("vertical_rate",) if self.steps is not None else ()))


@dataclass(frozen=True)
class Solution:
    """Readings of all columns, and how well these then agree.

    Attributes:
        readings: Column -> reading.
        misfits: Pair of columns, in words -> how much they differ, over the difference that is allowed.
        differences: The same pairs -> the difference itself.
        possible: Whether airliners fly so at all.

    Example:
        >>> Solution({"IAS": AS_GIVEN}, {"IAS and Mach": 0.1}, {"IAS and Mach": 0.006}, True).agrees
        True
    """

    readings: dict[str, Reading]
    misfits: dict[str, float] = field(default_factory=dict)
    differences: dict[str, float] = field(default_factory=dict)
    possible: bool = True

    @property
    def agrees(self) -> bool:
        """True if all columns agree and are possible."""
        return self.possible and all(misfit <= 1 for misfit in self.misfits.values())

    @property
    def changed(self) -> dict[str, Reading]:
        """Columns that are not read as expected."""
        return {name: reading for name, reading in self.readings.items() if reading.words}

    @property
    def rank(self) -> tuple[float, int, float]:
        """Fewest changes first, then those that compare most columns."""
        return sum(one.cost for one in self.readings.values()), -len(self.misfits), sum(self.misfits.values())

    def mends(self, given: "Solution") -> bool:
        """True if columns that contradicted as given are compared and agree closely, where no wind lies between."""
        off = [name for name, reading in self.readings.items() if reading.off]
        windy = bool(self.readings["IAS"].meaning)
        return all(
            self.misfits.get(pair, np.inf) <= (1.0 if windy or "groundspeed" in pair else CLOSELY)
            or any(name in pair for name in off)
            for pair, misfit in given.misfits.items()
            if misfit > 1
        )


def as_given(evidence: Evidence) -> Solution:
    """Agreement of the columns as they are.

    Example:
        >>> mach = mach_of_cas(np.full(30, 266.0), np.full(30, 35e3))
        >>> columns = {"altitude": np.full(30, 35e3), "IAS": np.full(30, 266.0), "Mach": mach}
        >>> as_given(Evidence(columns)).agrees
        True
    """
    return judged(evidence, dict.fromkeys(evidence.given, AS_GIVEN))


def agreeing(evidence: Evidence, given: Solution) -> list[Solution]:
    """Readings in which all columns agree, the ones that change least first.

    Args:
        evidence: The columns.
        given: How they agree as they are.

    Example:
        >>> speeds = np.linspace(250.0, 300.0, 30)
        >>> columns = {"altitude": np.full(30, 30e3), "IAS": 1.852 * speeds, "Mach": mach_of_cas(speeds, 30e3)}
        >>> evidence = Evidence(columns)
        >>> agreeing(evidence, as_given(evidence))[0].changed["IAS"].words
        'in km/h'
    """
    found = [one for one in _tried(evidence) if one.agrees and one.mends(given)]
    return sorted(found, key=lambda one: one.rank)


def _tried(evidence: Evidence) -> Iterator[Solution]:
    """Every reading of altitude, IAS and Mach; the others agree with these, or not, each for itself."""
    first: list[str] = [name for name in ("altitude", "IAS", "Mach") if name in evidence.given]
    others = [name for name in evidence.given if name not in first]
    for combination in itertools.product(*(READINGS[name] for name in first)):
        readings: dict[str, Reading] = dict(zip(first, combination, strict=True))
        core = judged(evidence, readings)
        if not core.agrees:
            continue
        for name in others:
            tried = (judged(evidence, {**readings, name: reading}, only=name) for reading in READINGS[name])
            best = min((one for one in tried if one.agrees), key=lambda one: one.rank)
            readings[name] = best.readings[name]
        yield judged(evidence, readings)


def judged(evidence: Evidence, readings: dict[str, Reading], only: str = "") -> Solution:
    """Agreement of the columns by this reading.

    Args:
        evidence: The columns.
        readings: Of some columns, altitude among them; the others are not looked at.
        only: Compare this column alone with the others.

    Example:
        >>> columns = {"altitude": np.full(30, 9e3), "IAS": np.full(30, 266.0)}
        >>> judged(Evidence(columns), {"altitude": AS_GIVEN, "IAS": AS_GIVEN}).possible
        True
    """
    values = {name: array * readings[name].factor for name, array in evidence.columns.items() if name in readings}
    altitude = values["altitude"]
    with np.errstate(all="ignore"):
        machs: dict[str, Array] = {
            name: _mach(name, values[name], altitude, readings[name])
            for name in ("Mach", "IAS", "TAS", "groundspeed")
            if name in values and not readings[name].off
        }
        pairs = _compared(machs, altitude, values, readings)
        for name in machs:
            if readings[name].meaning and not _is_earned(name, values[name], machs, altitude):
                pairs[f"{name} and {readings[name].meaning}"] = OPPOSITE, 1.0
        if evidence.steps is not None and not (rate := readings.get("vertical_rate", OFF)).off:
            pairs["vertical_rate and the change of altitude"] = (
                evidence.steps.difference(readings["altitude"].factor, rate.factor, rate.meaning),
                evidence.steps.ALLOWED,
            )
        known = {pair: found for pair, found in pairs.items() if np.isfinite(found[0]) and only in pair}
        mach = next((machs[name] for name in ("Mach", "IAS", "TAS") if name in machs), None)
        top_ft = LOWEST_TOP_FT if readings["altitude"] == AS_GIVEN else LOWEST_READ_FT
        possible = _possible(altitude, mach, evidence.columns["IAS"], top_ft)
    misfits = {pair: abs(difference) / allowed for pair, (difference, allowed) in known.items()}
    return Solution(readings, misfits, {pair: found[0] for pair, found in known.items()}, possible)


def _mach(name: str, values: Array, altitude: Array, reading: Reading) -> Array:
    """Mach number that a speed makes."""
    if name == "Mach":
        return values
    if (reading.meaning or ("TAS" if name == "groundspeed" else name)) == "IAS":
        return mach_of_cas(np.where(values < 1000, values, np.nan), altitude)
    return values / isa_tas_of_mach_kt(np.ones_like(altitude), altitude)


def _is_earned(name: str, values: Array, machs: dict[str, Array], altitude: Array) -> bool:
    """True for a column that follows the quantity that it is read as, and not its own by a factor."""
    other = next((machs[one] for one in ("Mach", "IAS", "TAS") if one in machs and one != name), None)
    if other is None:
        return True
    own, read = (
        np.log(one / other)[(altitude > SHORT_FT) & np.isfinite(one * other)]
        for one in (_mach(name, values, altitude, AS_GIVEN), machs[name])
    )
    if min(len(own), len(read)) < MIN_VALUES:
        return True
    return bool(np.ptp(np.quantile(own, (0.25, 0.75))) >= EARNED * np.ptp(np.quantile(read, (0.25, 0.75))))


def _compared(
    machs: dict[str, Array], altitude: Array, values: dict[str, Array], readings: dict[str, Reading]
) -> dict[str, tuple[float, float]]:
    """Pair of columns -> difference, and what is allowed; NaN where too few rows have both."""
    found = {}
    high = (altitude > SHORT_FT) & (altitude < POSSIBLE["altitude"][1])
    flying = altitude < POSSIBLE["altitude"][1]
    if "Mach" in machs and "IAS" in machs:
        is_tas = readings["IAS"].meaning == "TAS"
        speed = isa_tas_of_mach_kt if is_tas else cas_of_mach_kt
        ratio = np.log(values["IAS"] / speed(machs["Mach"], altitude))
        found["IAS and Mach"] = _median(np.abs(ratio), flying), WIND if is_tas else AGREES
    other = "Mach" if "Mach" in machs else "IAS"
    if "TAS" in machs and other in machs:
        allowed = AIR if other == "Mach" else BOTH
        found[f"TAS and {other}"] = _median(np.abs(np.log(machs["TAS"] / machs[other])), high), allowed
    other = next((name for name in ("TAS", "Mach", "IAS") if name in machs), "")
    if "groundspeed" in machs and other:
        ratio = np.log(np.maximum(machs["groundspeed"], 1e-3) / machs[other])
        found[f"groundspeed and {other}"] = _median(ratio, high), WINDS
    return found


def _median(values: Array, where: NDArray[np.bool_]) -> float:
    chosen = values[where & ~np.isnan(values)]
    return float(np.median(chosen)) if len(chosen) >= MIN_VALUES else np.nan


def _possible(altitude: Array, mach: Array | None, ias: Array, top_ft: float) -> bool:
    """Test for possible flight: within the atmosphere, above the ground, and at Mach numbers of the altitude."""
    if np.median(altitude) > POSSIBLE["altitude"][1]:
        return False
    if np.quantile(altitude, 0.995) < top_ft and np.median(ias) > TAXI_KT:
        return False
    if mach is None:
        return True
    high = (altitude > HIGH_FT) & (altitude < POSSIBLE["altitude"][1])
    cas_kt = _median(cas_of_mach_kt(mach, altitude), high)
    if not np.isnan(cas_kt):
        return bool(cas_kt > SLOWEST_KT and _median(mach, high) < FASTEST_MACH)
    return not _median(mach, altitude < POSSIBLE["altitude"][1]) > FASTEST_MACH
