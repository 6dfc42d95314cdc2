"""CAS and Mach number of each other at a pressure altitude, for checks of rows and for columns that lack.

The same ISA and impact-pressure relations as :mod:`descentflow.physics`, to which a test holds it; in numpy, because
surveillance never imports torch.
"""

from collections.abc import Callable, Iterable

import numpy as np
import polars as pl
from numpy.typing import NDArray

from descentflow.core.constants import KAPPA, P0_PA, R_AIR, RHO0_KG_M3
from descentflow.core.isa import pressure_ratio, standard_k
from descentflow.core.units import FT_M, KT_MPS
from descentflow.surveillance.rows.drop_report import DropReport
from descentflow.surveillance.rows.schema import AIRSPEEDS, COLUMNS, POSSIBLE

Array = NDArray[np.float64]


def isa_tas_of_mach_kt(mach: Array, altitude_ft: Array) -> Array:
    """True airspeed in the standard atmosphere, kt."""
    return np.asarray(mach * np.sqrt(KAPPA * R_AIR * standard_k(altitude_ft * FT_M)) / KT_MPS)


def cas_of_mach_kt(mach: Array, altitude_ft: Array) -> Array:
    """Calibrated airspeed in kt."""
    impact = pressure_ratio(altitude_ft * FT_M) * ((1 + 0.2 * mach**2) ** 3.5 - 1)
    scale_mps = np.sqrt(KAPPA * P0_PA / RHO0_KG_M3)
    return np.asarray(scale_mps * np.sqrt(5 * ((1 + impact) ** (1 / 3.5) - 1)) / KT_MPS)


def mach_of_cas(cas_kt: Array, altitude_ft: Array) -> Array:
    """Mach number, the inverse of :func:`cas_of_mach_kt`."""
    scale_mps = np.sqrt(KAPPA * P0_PA / RHO0_KG_M3)
    impact = ((1 + 0.2 * (cas_kt * KT_MPS / scale_mps) ** 2) ** 3.5 - 1) / pressure_ratio(altitude_ft * FT_M)
    return np.asarray(np.sqrt(5 * ((1 + impact) ** (1 / 3.5) - 1)))


MACH_COMPUTED = "values of Mach computed from IAS and altitude"
"""Note in the report of rows whose source has no Mach."""
IAS_COMPUTED = "values of IAS computed from Mach and altitude"
"""Note in the report of rows whose source has no IAS."""
MACH_MISSING = 0.25
"""Share of rows with a Mach number below which the others' is computed: the source hardly reports it."""


def computable(names: Iterable[str]) -> set[str]:
    """The airspeed that columns can stand without, because it follows from the other one and altitude."""
    lacking = {"IAS", "Mach"} - set(names)
    return lacking if "altitude" in names and len(lacking) == 1 else set()


def with_ias(rows: pl.DataFrame, report: DropReport) -> pl.DataFrame:
    """Rows with IAS computed from Mach and pressure altitude, if no row has any."""
    if "Mach" not in rows.columns or ("IAS" in rows.columns and rows["IAS"].count()):
        return rows
    ias = _made(rows, "Mach", cas_of_mach_kt)
    report.note(IAS_COMPUTED, ias.count())
    return rows.with_columns(IAS=ias).select(name for name in COLUMNS if name == "IAS" or name in rows.columns)


def reports_airspeeds(rows: pl.DataFrame) -> bool:
    """True for rows of which some have IAS or Mach."""
    return any(rows[name].count() for name in AIRSPEEDS if name in rows.columns)


def mach_reported(rows: pl.DataFrame) -> float:
    """Share of the rows with IAS and altitude that have a Mach number too; 1 if there are none."""
    if not {"altitude", "IAS"} <= set(rows.columns):
        return 1.0
    usable = rows.drop_nulls(["altitude", "IAS"])
    if "Mach" not in usable.columns:
        return 0.0
    return usable["Mach"].count() / len(usable) if len(usable) else 1.0


def with_mach(rows: pl.DataFrame, report: DropReport, note: str = MACH_COMPUTED) -> pl.DataFrame:
    """Rows with Mach computed from IAS and pressure altitude, where they have none.

    Instrument and position errors are neglected (IAS is CAS, as everywhere); the relation is that of
    :func:`~descentflow.surveillance.rows.air_data.mach_of_cas`. IAS and altitude cannot be checked against Mach then.
    """
    mach = _made(rows, "IAS", mach_of_cas)
    given = rows["Mach"] if "Mach" in rows.columns else pl.repeat(None, len(rows), dtype=pl.Float64, eager=True)
    rows = rows.with_columns(Mach=given.fill_null(mach))
    report.note(note, rows["Mach"].count() - given.count())
    return rows.select(name for name in COLUMNS if name in rows.columns)


def _made(rows: pl.DataFrame, name: str, conversion: Callable[[Array, Array], Array]) -> pl.Series:
    """The other airspeed of one and pressure altitude, missing where either is missing or impossible."""
    possible = [pl.when(pl.col(column).is_between(*POSSIBLE[column])).then(column) for column in (name, "altitude")]
    return pl.Series(conversion(*(column.to_numpy() for column in rows.select(possible)))).fill_nan(None)
