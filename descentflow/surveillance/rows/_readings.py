"""Units, signs and meanings of columns by physics: the readings in which all columns of the same rows agree.

Columns of a row follow from each other: IAS from Mach and altitude, TAS from Mach in nearly standard air, groundspeed
from TAS but for wind, and the vertical rate from altitudes of neighbouring rows. The :data:`READINGS` of each column,
and those of :data:`TOGETHER`, are judged by how much these then differ.
"""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field

import numpy as np
import polars as pl
from numpy.typing import NDArray

from descentflow.core.units import FPM_MPS, FT_M, KT_MPS
from descentflow.surveillance.rows.air_data import Array, cas_of_mach_kt, isa_tas_of_mach_kt, mach_of_cas
from descentflow.surveillance.rows.schema import FILLS, MIN_CHECKED_VALUES, POSSIBLE

MIN_AIRCRAFT = 3
"""Aircraft below which neither groundspeed nor angles are compared: one in 160 kt of headwind looks as if it were in
m/s, and one may fly north all the time; and below which a column that no unit explains is a warning: a register of one
aircraft may be broken."""
MAX_COMPARED_ROWS = 20_000
MAX_RATE_ROWS = 200_000
"""First rows of a file whose rates are compared: differences need neighbours."""
MAX_IAS_OF_MACH = 0.06
"""Median relative difference of IAS and the CAS of Mach below which they agree; real sources have 0.002 to 0.023."""
MAX_TAS_OF_MACH = 0.10
"""The same of TAS and the TAS of Mach in standard air: air 50 K hotter makes it; real sources have 0.004 to 0.027."""
MAX_TAS_OF_IAS = 0.12
"""The same of TAS and IAS, where there is no Mach between them."""
MAX_IAS_AS_TAS = 0.15
"""The same of an IAS that is a TAS or a groundspeed: half of the aircraft have less wind along their track."""
MAX_GROUNDSPEED_OF_TAS = 0.25
"""Median of a groundspeed over TAS, as a logarithm: winds of all tracks nearly cancel; 0.16 in a jet of 210 kt."""
MAX_RATE_OF_CHANGE = 0.15
"""The same of a rate over the change of altitude: real sources have up to 0.035, their 52 aircraft up to 0.126."""
LOWEST_TAS_FT = 3000.0
"""Altitude below which TAS and groundspeed are not compared."""
HIGH_FT, SLOWEST_KT, FASTEST_MACH = 28_000.0, 145.0, 0.98
"""Above this altitude most rows of airliners and business aircraft have more CAS and less Mach: a PC12 flies
some 150 kt at its ceiling, and 270 kt in m/s are 139."""
LOWEST_TOP_FT, TAXI_KT = 700.0, 150.0
"""Rows of which none is above this, at more than this speed, are of flight levels that are taken for feet."""
LOWEST_READ_FT = 10_000.0
"""Rows whose altitude is read in another unit reach this: what is below has no descents."""
MAX_SPREAD_OF_OTHER = 0.5
"""Spread of a column about its own quantity, over that about another one, below which it is not the other one: the
ratio of TAS and IAS changes with altitude, a factor does not."""
MAX_SHARE_OF_ALLOWED = 0.55
"""Share of the allowed difference that another unit leaves where columns contradict each other as given, at most."""
OFF_COST = 6.0
"""A column that no unit explains counts as much as so many that are in another unit."""
SLOWEST_FPM, FASTEST_FPM = 800.0, 6000.0
"""Rates of the steps that are compared: rounded altitudes say little of slower ones."""
SHORTEST_STEP_S, LONGEST_STEP_S = 8.0, 60.0
"""Length of a step: an altitude that is rounded to 100 ft and changes between two values in level flight changes by 750
ft/min over the least of it, and by 1,500 over 4 s."""
LEAP_FPM = 20_000.0
"""Change that no aircraft makes: to a value that stands for none, or from one."""
UNREAL_FPM = 1e9
"""Change in no unit of any altitude: what has it is no number of an altitude."""
OPPOSITE = 99.0
"""Difference of a rate from a change of the other sign: larger than any of units."""


@dataclass(frozen=True)
class Reading:
    """Reading of a column's values: unit, sign and meaning.

    Attributes:
        words: Its words in a message; empty for the expected unit.
        factor: To the expected unit.
        meaning: The quantity that it is instead, `TAS` or `IAS`, or `unsigned`; empty for the one that it should be.
        off: Whether no unit is assumed: the column is left out of all comparisons.
    """

    words: str
    factor: float = 1.0
    meaning: str = ""
    off: bool = False

    @property
    def cost(self) -> float:
        """Cost among the changes that make columns agree."""
        return OFF_COST if self.off else float(bool(self.words))


AS_GIVEN, OFF = Reading(""), Reading("wrong", off=True)
METRES, MPS, MPS_RATE = Reading("in metres", 1 / FT_M), Reading("in m/s", 1 / KT_MPS), Reading("in m/s", 1 / FPM_MPS)
LESSENED = Reading("divided by 100", 100.0)
IS_TAS, IS_IAS = Reading("TAS or groundspeed", meaning="TAS"), Reading("IAS", meaning="IAS")
SPEEDS = (MPS, Reading("in km/h", 1 / 1.852), Reading("multiplied by 100", 0.01), LESSENED)
SINKS = "with the sign of a sink rate"
READINGS: dict[str, tuple[Reading, ...]] = {
    "altitude": (METRES, Reading("in hundreds of feet", 100.0)),
    "IAS": (*SPEEDS, IS_TAS, OFF),
    "Mach": (Reading("in hundredths", 0.01), LESSENED, OFF),
    "TAS": (*SPEEDS, IS_IAS, OFF),
    "groundspeed": (*SPEEDS, IS_IAS, OFF),
    "vertical_rate": (
        MPS_RATE,
        Reading("in hundreds of ft/min", 100.0),
        Reading("raw counts of 32 ft/min (register BDS 6,0)", 32.0),
        Reading("raw counts of 64 ft/min (ADS-B)", 64.0),
        Reading("doubled", 0.5),
        Reading("halved", 2.0),
        Reading(SINKS, -1.0),
        Reading("without a sign", meaning="unsigned"),
        OFF,
    ),
}
"""Column -> its readings but for the expected one: those that tables were met with."""
SPEEDS_MPS = {"IAS": MPS, "TAS": MPS, "groundspeed": MPS}
TOGETHER: tuple[dict[str, Reading], ...] = (
    {"IAS": IS_TAS, "TAS": IS_IAS},
    {"altitude": METRES, "vertical_rate": MPS_RATE},
    SPEEDS_MPS,
    {"altitude": METRES, **SPEEDS_MPS},
    {"altitude": METRES, **SPEEDS_MPS, "vertical_rate": MPS_RATE},
)
"""Columns that were met in other readings at once: swapped speeds, and tables in SI units."""


@dataclass(frozen=True)
class UnitEvidence:
    """Columns of the same rows, as given; (n,) each, NaN where missing.

    Attributes:
        columns: `altitude`, `IAS`, and those of `Mach`, `TAS` and `groundspeed` that the source gives; none of too few
            rows.
        steps: As :func:`steps_of`.
    """

    columns: dict[str, Array]
    steps: pl.DataFrame

    @classmethod
    def of(cls, rows: pl.DataFrame) -> "UnitEvidence":
        """Columns that can be compared, of a sample of rows."""
        names = [name for name in ("altitude", "IAS", "Mach", "TAS", "groundspeed") if name in rows.columns]
        if rows["icao24"].n_unique() < MIN_AIRCRAFT:
            names = [name for name in names if name != "groundspeed"]
        usable = rows.select(names).drop_nulls([name for name in names if name in ("altitude", "IAS", "Mach")])
        usable = usable.filter(flies())
        if "Mach" in names:
            flying, of_any_unit = (usable.filter(pl.col("Mach").is_between(0.2, most)) for most in (1.0, 1000.0))
            usable = flying if len(flying) >= MIN_CHECKED_VALUES else of_any_unit
        usable = usable.gather_every(max(len(usable) // MAX_COMPARED_ROWS, 1))
        columns: dict[str, Array] = {
            name: usable[name].cast(pl.Float64).to_numpy()
            for name in names
            if usable[name].count() >= MIN_CHECKED_VALUES
        }
        if "TAS" in columns:  # what stands for no value (9999, 0) is no evidence of a unit
            columns["TAS"] = np.where((columns["TAS"] > 0) & (columns["TAS"] < 2000), columns["TAS"], np.nan)
        return cls(columns, steps_of(rows.head(MAX_RATE_ROWS)))

    @property
    def given(self) -> dict[str, Reading]:
        """Columns that are compared, read as given."""
        return dict.fromkeys([*self.columns, *(["vertical_rate"] if len(self.steps) else [])], AS_GIVEN)


def flies() -> pl.Expr:
    """Mask of rows at possible altitudes with an airspeed of any unit."""
    return pl.col("altitude").is_between(*POSSIBLE["altitude"]) & pl.col("IAS").is_between(1.0, 1000.0)


@dataclass(frozen=True)
class Solution:
    """Readings of all columns, and how well these then agree.

    Attributes:
        readings: Column -> reading.
        pairs: Pair of columns, in words -> how much they differ (a logarithm), and how much they may.
        possible: Whether airliners fly so at all.
    """

    readings: dict[str, Reading]
    pairs: dict[str, tuple[float, float]] = field(default_factory=dict)
    possible: bool = True

    @property
    def misfits(self) -> dict[str, float]:
        """Pair -> its difference over the allowed one."""
        return {pair: abs(difference) / allowed for pair, (difference, allowed) in self.pairs.items()}

    @property
    def wrong(self) -> list[str]:
        """Pairs that differ by more than is allowed."""
        return [pair for pair, misfit in self.misfits.items() if misfit > 1]

    @property
    def agrees(self) -> bool:
        """True if all columns agree and are possible."""
        return self.possible and not self.wrong

    @property
    def changed(self) -> dict[str, Reading]:
        """Columns that are not read as expected."""
        return {name: reading for name, reading in self.readings.items() if reading.words}

    @property
    def off(self) -> list[str]:
        """Columns that no unit explains."""
        return [name for name, reading in self.readings.items() if reading.off]

    @property
    def rank(self) -> tuple[float, int, float]:
        """Fewest changes first, then those that compare most columns."""
        return sum(reading.cost for reading in self.readings.values()), -len(self.pairs), sum(self.misfits.values())

    def mends(self, given: "Solution") -> bool:
        """True if columns that contradicted as given are compared and agree closely, where no wind lies between."""
        windy = bool(self.readings["IAS"].meaning)
        return all(
            self.misfits.get(pair, np.inf) <= (1.0 if windy or "groundspeed" in pair else MAX_SHARE_OF_ALLOWED)
            or any(name in pair for name in self.off)
            for pair in given.wrong
        )


def tried(evidence: UnitEvidence, names: Iterable[str]) -> Iterator[dict[str, Reading]]:
    """Readings of all columns: each of these by itself in another one, and those that were met together."""
    given = evidence.given
    yield from ({**given, name: reading} for name in names for reading in READINGS[name])
    for together in TOGETHER:
        several = {name: reading for name, reading in together.items() if name in given}
        if len(several) > 1:
            yield {**given, **several}


def agreeing(evidence: UnitEvidence, given: Solution) -> list[Solution]:
    """Readings in which all columns agree, the ones that change least first; several if they do equally well."""
    solutions = (judged(evidence, readings) for readings in tried(evidence, evidence.given))
    best = sorted((each for each in solutions if each.agrees and each.mends(given)), key=lambda each: each.rank)
    return [each for each in best if each.rank[:2] == best[0].rank[:2] and each.rank[2] < best[0].rank[2] + 0.2]


def judged(evidence: UnitEvidence, readings: dict[str, Reading]) -> Solution:
    """Agreement of the columns by these readings."""
    values = {name: array * readings[name].factor for name, array in evidence.columns.items()}
    altitude = values["altitude"]
    with np.errstate(all="ignore"):
        machs: dict[str, Array] = {
            name: _mach(name, values[name], altitude, readings[name])
            for name in ("Mach", "IAS", "TAS", "groundspeed")
            if name in values and not readings[name].off
        }
        pairs = {
            pair: (difference, allowed)
            for pair, difference, allowed in _compared(evidence, machs, values, readings)
            if np.isfinite(difference)
        }
        return Solution(readings, pairs, _possible(machs, altitude, evidence.columns["IAS"], readings["altitude"]))


def _mach(name: str, values: Array, altitude: Array, reading: Reading) -> Array:
    """Mach number that a speed makes."""
    if name == "Mach":
        return values
    if (reading.meaning or ("TAS" if name == "groundspeed" else name)) == "IAS":
        return mach_of_cas(np.minimum(values, 1000.0), altitude)
    return values / isa_tas_of_mach_kt(np.ones_like(altitude), altitude)


def _compared(
    evidence: UnitEvidence, machs: dict[str, Array], values: dict[str, Array], readings: dict[str, Reading]
) -> Iterator[tuple[str, float, float]]:
    """Pair of columns, difference, and what is allowed; NaN where too few rows have both."""
    altitude = values["altitude"]
    flying = altitude < POSSIBLE["altitude"][1]
    high = flying & (altitude > LOWEST_TAS_FT)
    if "Mach" in machs and "IAS" in machs:
        is_tas = readings["IAS"].meaning == "TAS"
        made = (isa_tas_of_mach_kt if is_tas else cas_of_mach_kt)(machs["Mach"], altitude)
        yield (
            "IAS and Mach",
            _median(np.abs(np.log(values["IAS"] / made)), flying),
            MAX_IAS_AS_TAS if is_tas else MAX_IAS_OF_MACH,
        )
    other = "Mach" if "Mach" in machs else "IAS"
    if "TAS" in machs and other in machs:
        ratio = np.abs(np.log(machs["TAS"] / machs[other]))
        yield f"TAS and {other}", _median(ratio, high), MAX_TAS_OF_MACH if other == "Mach" else MAX_TAS_OF_IAS
    other = next((name for name in ("TAS", "Mach", "IAS") if name in machs), "")
    if "groundspeed" in machs and other:
        ratio = np.log(np.maximum(machs["groundspeed"], 1e-3) / machs[other])
        yield f"groundspeed and {other}", _median(ratio, high), MAX_GROUNDSPEED_OF_TAS
    for name in machs:
        if readings[name].meaning and not _is_earned(name, values[name], machs, altitude):
            yield f"{name} and {readings[name].meaning}", OPPOSITE, 1.0
    rate = readings.get("vertical_rate", OFF)
    if not rate.off:
        difference = _rate_difference(evidence.steps, readings["altitude"].factor, rate)
        yield "vertical_rate and the change of altitude", difference, MAX_RATE_OF_CHANGE


def _is_earned(name: str, values: Array, machs: dict[str, Array], altitude: Array) -> bool:
    """True for a column that follows the quantity that it is read as, and not its own by a factor."""
    other = next((machs[kind] for kind in ("Mach", "IAS", "TAS") if kind in machs and kind != name), altitude * np.nan)
    own, read = (
        np.log(mach / other)[(altitude > LOWEST_TAS_FT) & np.isfinite(mach * other)]
        for mach in (_mach(name, values, altitude, AS_GIVEN), machs[name])
    )
    if min(len(own), len(read)) < MIN_CHECKED_VALUES:
        return True
    return bool(np.ptp(np.quantile(own, (0.25, 0.75))) >= MAX_SPREAD_OF_OTHER * np.ptp(np.quantile(read, (0.25, 0.75))))


def _median(values: Array, where: NDArray[np.bool_]) -> float:
    chosen = values[where & ~np.isnan(values)]
    return float(np.median(chosen)) if len(chosen) >= MIN_CHECKED_VALUES else np.nan


def _possible(machs: dict[str, Array], altitude: Array, ias: Array, reading: Reading) -> bool:
    """Test for possible flight: within the atmosphere, above the ground, and at Mach numbers of the altitude."""
    top_ft = LOWEST_TOP_FT if reading == AS_GIVEN else LOWEST_READ_FT
    if np.median(altitude) > POSSIBLE["altitude"][1]:
        return False
    if np.quantile(altitude, 0.995) < top_ft and np.median(ias) > TAXI_KT:
        return False
    mach = next((machs[name] for name in ("Mach", "IAS", "TAS") if name in machs), altitude * np.nan)
    flying = altitude < POSSIBLE["altitude"][1]
    high = flying & (altitude > HIGH_FT)
    cas_kt = _median(cas_of_mach_kt(mach, altitude), high)
    if not np.isnan(cas_kt):
        return bool(cas_kt > SLOWEST_KT and _median(mach, high) < FASTEST_MACH)
    return not _median(mach, flying) > FASTEST_MACH


def _rate_difference(steps: pl.DataFrame, altitude_factor: float, reading: Reading) -> float:
    """Logarithm of rate over change, the median of climbs or of descents, whichever is worse; NaN of too few."""
    change, rate = (steps[name].to_numpy() for name in ("change", "reported"))
    change, rate = change * altitude_factor, rate * reading.factor
    moving = np.zeros(len(change), dtype=bool)
    for speed in (change, rate):
        moving |= (np.abs(speed) >= SLOWEST_FPM) & (np.abs(speed) <= FASTEST_FPM)
    moving &= np.abs(change) < LEAP_FPM
    differences = []
    for sign in (-1, 1):
        chosen = moving & (np.sign(change) == sign)
        if chosen.sum() >= MIN_CHECKED_VALUES:
            ratio = float(np.median(rate[chosen] / np.abs(change[chosen]))) * (1 if reading.meaning else sign)
            differences.append(abs(float(np.log(ratio))) if ratio > 1e-9 else OPPOSITE)
    # Rates without a sign are known by both: with descents alone they are sink rates.
    return np.nan if not differences else OPPOSITE if reading.meaning and len(differences) < 2 else max(differences)


def steps_of(rows: pl.DataFrame) -> pl.DataFrame:
    """Steps of 8 to 60 s of one flight, or aircraft; none if the rows report no rate."""
    names = [name for name in ("flight_id", "icao24") if name in rows.columns]
    if "vertical_rate" not in rows.columns:
        return rows.select(names).clear().with_columns(change=0.0, reported=0.0)
    rows = rows.filter(~pl.col("altitude").is_in(FILLS)).sort(*names, "timestamp", maintain_order=True)
    possible = pl.col("vertical_rate").is_between(*POSSIBLE["vertical_rate"])
    seen = rows.select(
        *names,
        altitude=pl.col("altitude").cast(pl.Float64),
        reported=pl.when(possible).then(pl.col("vertical_rate")).cast(pl.Float64),
        time_us=pl.col("timestamp").dt.epoch("us").fill_null(0),
        flight=pl.any_horizontal(pl.col(name).ne_missing(pl.col(name).shift()) for name in names).cum_sum(),
    )
    begins = seen.select("flight", "time_us", begin_us="time_us", begin="altitude")
    # The last row that is old enough for a step.
    both = seen.with_columns(pl.col("time_us") - int(1e6 * SHORTEST_STEP_S)).join_asof(
        begins, on="time_us", by="flight", check_sortedness=False
    )
    seconds = (pl.col("time_us") - pl.col("begin_us")) / 1e6 + SHORTEST_STEP_S
    change = (pl.col("altitude") - pl.col("begin")) / seconds * 60
    return both.filter(
        seconds <= LONGEST_STEP_S, change != 0, change.abs() < UNREAL_FPM, pl.col("reported").is_finite()
    ).select(*names, change=change, reported="reported")
