"""Record that assurance asks for: domain, independence, uncertainty, and where the evidence of each factor stands."""

from collections.abc import Sequence

import polars as pl
from torch import Tensor

from descentflow.core.mode_s_steps import UNCERTAINTY
from descentflow.core.units import KT_MPS
from descentflow.diagnosis.findings.aviation_units import between, with_unit
from descentflow.diagnosis.findings.findings import SEEN
from descentflow.diagnosis.report.gap_report import GapReport
from descentflow.diagnosis.sides.two_sides import Compared
from descentflow.physics.airspeed import cas_to_mach, mach_to_tas_mps
from descentflow.qualification.limits import UNITS
from descentflow.qualification.record import Row

REPORTED = {"airspeed": "IAS", "rate": "vertical_rate"}
"""Quantity -> the channel that reports it."""


def domain_of(frame: pl.DataFrame, compared: Compared) -> dict[str, str]:
    """Types, levels, days, places and weather of the real flights: the answer holds there and not elsewhere.

    Args:
        frame: Prepared real descents.
        compared: The same, measured.
    """
    low, high = compared.levels()
    flights = frame["flight_id"].n_unique()
    domain = {
        "types": ", ".join(sorted(frame["typecode"].drop_nulls().unique().to_list())) or "not named",
        "flights": f"{int(compared.real.sum()):,} of {flights:,}, of {frame['icao24'].n_unique():,} aircraft",
        "levels": f"FL{low:.0f} to FL{high:.0f}, free descents alone: level-offs and held rates are cut out",
    }
    first, last = frame.select(first=pl.min("timestamp"), last=pl.max("timestamp")).row(0)
    if first is not None:
        days = frame["timestamp"].dt.date().n_unique()
        domain["days"] = f"{first.date().isoformat()} to {last.date().isoformat()}, {days} of them with flights"
    if {"latitude", "longitude"} <= set(frame.columns) and frame["latitude"].is_not_null().any():
        ends = frame.select(
            pl.col(name).quantile(q).alias(f"{name} {q}") for name in ("latitude", "longitude") for q in (0.05, 0.95)
        ).row(0)
        domain["places"] = "latitude {:.1f} to {:.1f}, longitude {:.1f} to {:.1f} (nine in ten rows)".format(*ends)
    speeds = _nine_in_ten(compared.state.cas_mps[compared.real] / KT_MPS, "{:.0f} to {:.0f}")
    domain["airspeeds"] = f"CAS {speeds} kt (nine in ten)"
    domain["weather"] = _weather(compared)
    return domain


def _weather(compared: Compared) -> str:
    """Temperature and wind of the real flights as they measured them."""
    said = []
    warmth = compared.table("tas", compared.y)[compared.real]
    if bool(warmth.isfinite().any()):
        altitude, cas = compared.state.altitude_m, compared.state.cas_mps[compared.real]
        standard = mach_to_tas_mps(cas_to_mach(cas, altitude), altitude) / cas_to_mach(cas, altitude)
        # The speed of sound goes with the root of the temperature.
        kelvin = (standard**2 / (1.4 * 287.05287) * (2.0 * warmth).expm1()).nanmean(1)
        said.append(f"temperature ISA {_nine_in_ten(kelvin)} K")
    tailwind = compared.state.tailwind_mps[compared.real]
    if bool((tailwind != 0).any()):
        said.append(f"wind along the track {_nine_in_ten(tailwind.nanmean(1) / KT_MPS)} kt")
    return f"{', '.join(said)} (nine in ten flights)" if said else "not reported"


def _nine_in_ten(values: Tensor, ends: str = "{:+.0f} to {:+.0f}") -> str:
    known = values[values.isfinite()]
    # Integers have no minus zero: a wind of -0.3 kt is not "-0".
    return ends.format(*(round(float(known.quantile(q))) for q in (0.05, 0.95)))


def independence_of(gap: GapReport) -> str:
    """Sentence on whether the flights that judge were used to make the simulator."""
    seen, kind = gap.dropped.get(SEEN, 0), gap.provenance.simulator.kind
    if seen:
        return f"{seen:,} of these flights were used to fit the simulator. They are no independent judgement of it."
    if kind.startswith("checkpoint"):
        return "The checkpoint names the flights that it was fitted to; none of these is among them."
    if gap.provenance.real.fingerprint and gap.provenance.real.fingerprint == gap.provenance.simulator.fingerprint:
        return "Both sides are the same flights. This judges nothing."
    return "Not known from the data. Its maker states here whether these flights were used: ____________________"


def budget_of(rows: Sequence[Row], gap: GapReport) -> dict[str, str]:
    """Sources of uncertainty, and the size of each on the mean over all levels where it is known.

    Args:
        rows: Judgements; the last of a quantity is that of all levels.
        gap: Diagnosis of the same flights.
    """
    whole = {row.quantity: row for row in rows if row.minutes is None and row.difference is not None}
    sampling, reports = [], []
    for quantity, row in whole.items():
        label, unit = UNITS[quantity]
        assert row.difference is not None
        if row.difference.low is not None and row.difference.high is not None:
            half = (row.difference.high - row.difference.low) / 2
            sampling.append(f"{label} ± {with_unit(half, unit)}")
        if quantity in REPORTED:
            reports.append(f"{label} {with_unit(UNCERTAINTY[REPORTED[quantity]], unit)}")
    budget = {
        "flights (90 %, by whole aircraft and days)": "; ".join(sampling) or "unknown: one aircraft or none",
        "rounding of one report (standard uncertainty)": "; ".join(reports) or "not estimated for predictions",
    }
    rate = whole.get("rate")
    if rate is not None:
        air = "unknown: both sides must report TAS, groundspeed, track and heading"
        if rate.by_air is not None:
            air = f"{with_unit(rate.by_air, 'ft/min', signed=True)} of the mean rate is by the air of the flights"
        budget["air"] = air
    aircraft = gap.provenance.coefficients
    stands = f"{aircraft.typecode}, {aircraft.source}" if aircraft else gap.details.typecode
    budget["coefficients"] = f"{stands}: they carry rates between airspeeds; their error is not in the intervals"
    return budget


def factors_of(gap: GapReport, source: str) -> dict[str, str]:
    """The eight factors of credibility of NASA-STD-7009 (2008), and where the evidence of each stands.

    Args:
        gap: Diagnosis of the same flights.
        source: Of the limits.
    """
    made = gap.provenance
    costs = [cost for cost in gap.costs if cost.name == "time_at_speed"][:1]
    left = f" Time at equal speed differs by {between(costs[0].before, 's')}." if costs else ""
    return {
        "verification": "Not of the simulator. Of these numbers: the tests of descentflow "
        + ", ".join(f"{name} {version}" for name, version in made.versions.items())
        + ", and its record of verdicts on known differences.",
        "validation": f"This record, against {source}.{left}",
        "input pedigree": "Under “Where the flights come from”: files, versions, rows left out, fingerprints.",
        "results uncertainty": "Under “What is unsure”: what is quantified, and what is not.",
        "results robustness": f"Diagnosis: {gap.verdict}; "
        + (", ".join(cause.label or cause.effect for cause in gap.causes) or "no cause is named")
        + ". Other effects and their least visible sizes are on its own page.",
        "use history": "Not known from the data: ____________________",
        "management of the model": "Not known from the data: ____________________",
        "qualification of people": "Not known from the data: ____________________",
    }
