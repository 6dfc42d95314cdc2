"""Each flight's columns over what its other columns make of them, and the flights that others contradict."""

import numpy as np
import polars as pl

from descentflow.surveillance.rows.air_data import cas_of_mach_kt, isa_tas_of_mach_kt, mach_of_cas
from descentflow.surveillance.rows.rate_readings import Steps, ratios_of_rates
from descentflow.surveillance.rows.readings import AGREES, BOTH, MIN_VALUES, SHORT_FT, Evidence, agreeing, as_given
from descentflow.surveillance.rows.schema import POSSIBLE
from descentflow.surveillance.rows.units_words import readings_in_words

ALLOWED = {"IAS": AGREES, "TAS": BOTH, "groundspeed": 0.5, "vertical_rate": Steps.ALLOWED}
"""Column -> logarithm of the median ratio of a flight up to which it agrees; wind makes 0.4 of a
groundspeed (100 kt against 300)."""
MIXED = 0.1
"""Share of flights that agree from which the others are named, and the table is not refused as a whole."""
SHOWN = 5
"""Flights that a message names."""


def contradicting_flights(rows: pl.DataFrame) -> str:
    """Words for flights whose columns agree in other units alone, while those of others agree as given; else empty.

    Example:
        >>> contradicting_flights(pl.read_parquet("rows.parquet"))
        ''
    """
    names = [name for name in ("flight_id", "icao24") if name in rows.columns]
    ratios = ratios_of_flights(rows)
    compared = [name for name in ALLOWED if name in ratios.columns]
    agrees = [(pl.col(name).log().abs() <= ALLOWED[name]).fill_null(True) for name in compared]
    wrong = ratios.filter(~pl.all_horizontal(True, *agrees))
    number = len(ratios) - len(wrong)
    if wrong.is_empty() or number <= MIXED * len(ratios):
        return ""
    found: dict[str, list[str]] = {}
    # Flights of one sign and factor are of one source.
    alike = wrong.with_columns(pl.col(compared).sign() * (pl.col(compared).abs().log(2).round() + 99))
    for some in alike.partition_by(compared, maintain_order=True):
        evidence = Evidence.of(rows.join(some, on=names, how="semi"))
        given = None if evidence is None else as_given(evidence)
        best = [] if evidence is None or given is None or given.agrees else agreeing(evidence, given)[:1]
        if best and not any(reading.off for reading in best[0].readings.values()):
            found.setdefault(readings_in_words(best[0]), []).extend(some[names[0]])
    if not found:
        return ""
    said = (
        f"{len(which):,} flights ({', '.join(which[:SHOWN])}{', ...' * (len(which) > SHOWN)}) {words}"
        for words, which in found.items()
    )
    return (
        f"columns of some flights contradict each other: in {'; in '.join(said)}; the columns of {number:,} others "
        "agree as given: convert the rows of each source before they are put together"
    )


def ratios_of_flights(rows: pl.DataFrame) -> pl.DataFrame:
    """Medians of each flight: IAS over the CAS of Mach, TAS and groundspeed over the TAS of Mach, rate over change.

    Args:
        rows: In names and types of a row, in any order.

    Returns:
        Columns `flight_id icao24`, and one for each ratio that the columns make, null where a flight has too few rows;
        flights without any are left out.

    Example:
        >>> ratios_of_flights(pl.read_parquet("rows.parquet")).select(pl.col("IAS", "vertical_rate").median().round(1))
        shape: (1, 2)
        ...
    """
    names = [name for name in ("flight_id", "icao24") if name in rows.columns]
    flying = rows.filter(pl.col("altitude").is_between(*POSSIBLE["altitude"]), pl.col("IAS").is_between(1.0, 1000.0))
    values = {
        name: flying[name].cast(pl.Float64).to_numpy()
        for name in ("altitude", "IAS", "Mach", "TAS", "groundspeed")
        if name in rows.columns
    }
    altitude, ias = values["altitude"], values["IAS"]
    with np.errstate(all="ignore"):
        mach = values.get("Mach", mach_of_cas(ias, altitude))
        tas = np.where(altitude > SHORT_FT, isa_tas_of_mach_kt(mach, altitude), np.nan)
        made = {"TAS": tas, "groundspeed": tas} | ({"IAS": cas_of_mach_kt(mach, altitude)} if "Mach" in values else {})
        shares = {name: values[name] / other for name, other in made.items() if name in values}
    table = flying.select(names).with_columns(pl.Series(name, share).fill_nan(None) for name, share in shares.items())
    enough = [pl.when(pl.col(name).count() >= MIN_VALUES).then(pl.col(name).median()).alias(name) for name in shares]
    ratios = table.group_by(names, maintain_order=True).agg(enough)
    if "vertical_rate" in rows.columns:
        ratios = ratios.join(ratios_of_rates(rows), on=names, how="left", maintain_order="left")
    return ratios.filter(pl.any_horizontal(pl.exclude(names).is_not_null()))
