"""Flights whose drag is inferred in the air in which they flew, and descents flown in another than standard air."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import polars as pl
import torch
from torch import Tensor

from descentflow.air.energy_in_air import drag_in_air, in_air, rate_in_air
from descentflow.air.kept_air import KeptAir
from descentflow.air.level_air import LevelAir
from descentflow.core.errors import ConfigError
from descentflow.core.units import FL_M
from descentflow.physics.performance_model import PerformanceModel
from descentflow.representation.decoder.trajectories import Trajectories, summed_from_entry
from descentflow.representation.profiles import Profiles
from descentflow.representation.representation import Representation
from descentflow.weather.weather_layout import SUFFIXES, names_weather

if TYPE_CHECKING:
    from descentflow.air.measured_air import FlightAirs

MIN_LEVELS = 2
"""Levels that a flight must keep, as everywhere."""
STANDARD, MEASURED = "standard", "measured"
AirSource = str | Path | Sequence[str | Path]
"""``standard``, ``measured``, or a weather field: a NetCDF or GRIB file, a folder of them, or several."""


def with_own_air(
    profiles: Profiles, aircraft: PerformanceModel, airs: "FlightAirs", say: Callable[[str], None]
) -> Profiles:
    """The flights whose air is known, with their drag in it.

    Args:
        profiles: Flights whose drag was inferred in standard air.
        aircraft: Coefficients that inferred it, at the mass that did.
        airs: On the levels of the profiles or more at the top.
        say: Called with a count of the flights of whose air nothing is known: they are left out.

    Example:
        >>> import polars as pl
        >>> from descentflow.air.measured_air import measured_airs
        >>> from descentflow.aircraft_types.registry import aircraft
        >>> from descentflow.representation.profiles import profiles_from_frame
        >>> frame, a320 = pl.read_parquet("descents.parquet"), aircraft("A320")
        >>> profiles = profiles_from_frame(frame, a320, bottom_fl=150, top_fl=340)
        >>> airs = measured_airs(frame, profiles.levels_fl)
        >>> freed = with_own_air(profiles, a320, airs, print)
        >>> ratio = (freed.drag_n / profiles.drag_n)[freed.mask]  # the example's flights flew in standard air
        >>> bool((ratio.median() - 1).abs() < 0.005), freed.air.deviation_k.shape
        (True, torch.Size([120, 191]))
    """
    place = {flight: i for i, flight in enumerate(airs.flight_ids)}
    named = [i for i, flight in enumerate(profiles.flight_ids) if flight in place]
    chosen = profiles.subset(named)
    row, n_levels = [place[flight] for flight in chosen.flight_ids], len(profiles.levels_fl)
    air, known = airs.air.rows(row).levels(0, n_levels), airs.known[row][:, :n_levels]
    drag_n = drag_in_air(aircraft, chosen.cas_mps, chosen.rate_mps, chosen.drag_n, chosen.altitude_m, air)
    mask = chosen.mask & known
    levels_left = int(chosen.mask.sum() - mask.sum())
    kept = replace(chosen, drag_n=torch.where(mask, drag_n, 0.0), mask=mask, air=air)
    kept = kept.subset(torch.nonzero(mask.sum(1) >= MIN_LEVELS)[:, 0])
    if len(kept) < len(profiles):
        say(f"left out {len(profiles) - len(kept)} of {len(profiles)} flight(s) of whose air nothing is known")
    if levels_left:
        say(f"left out {levels_left:,} of {int(chosen.mask.sum()):,} levels at which the air is not known")
    return kept


def airs_by(air: AirSource, frame: pl.DataFrame, levels_fl: Tensor, *, wind: bool | None = None) -> "FlightAirs":
    """The airs of flights by their own reports, or by a weather field.

    Args:
        air: ``measured``, or a weather field.
        frame: Prepared descents.
        levels_fl: (L,) ascending whole flight levels.
        wind: Whether the wind must be known; if absent, where it is.

    Raises:
        ConfigError: If there is no such air.
        DataError: If nothing is known of the flights' air.

    Example:
        >>> airs_by("warm", pl.read_parquet("descents.parquet"), torch.arange(150, 341))
        Traceback (most recent call last):
        descentflow.core.errors.ConfigError: data.air = 'warm'; expected standard, measured, or a weather field: ...
    """
    # Here: most flights are flown in standard air, and would pay for its readers.
    from descentflow.air.field_air import field_airs
    from descentflow.air.measured_air import measured_airs

    if air == MEASURED:
        return measured_airs(frame, levels_fl, wind=wind)
    if isinstance(air, str | Path) and not names_weather(air):
        raise ConfigError(
            f"data.air = {str(air)!r}",
            expected=f"standard, measured, or a weather field: a file {', '.join(SUFFIXES)}, or a folder of them",
            mend="choose one of these",
        )
    return field_airs(frame, levels_fl, air, wind=wind)


def airs_as_kept(frame: pl.DataFrame, levels_fl: Tensor, kept: KeptAir, air: AirSource | None = None) -> "FlightAirs":
    """The airs of other flights, found as those of a model's training flights were, or by a source that is given.

    Args:
        frame: Prepared descents.
        levels_fl: (L,) ascending whole flight levels.
        kept: What the model keeps of its training flights' air.
        air: ``measured``, or a weather field; if absent, by the flights' reports where the training flights' was.

    Raises:
        ConfigError: If the training flights' air came from a weather field and nothing is given.
        DataError: If nothing is known of the flights' air.

    Example:
        >>> import polars as pl
        >>> from descentflow.air.level_air import LevelAir
        >>> frame, levels_fl = pl.read_parquet("descents.parquet"), torch.arange(150, 341)
        >>> kept = KeptAir("measured", True, LevelAir.uniform(levels_fl))
        >>> len(airs_as_kept(frame, levels_fl, kept).flight_ids)
        120
    """
    if air is None and kept.source == "field":
        raise ConfigError(
            "a model of drag in the air of a weather field, and no field of these flights",
            expected="the field of their days and places, or measured: their own reports",
            mend="give --air FILE or --air measured (data.air where a model is fitted or tested)",
        )
    return airs_by(MEASURED if air is None else air, frame, levels_fl, wind=kept.wind)


def check_air_asked(representation: Representation, air: AirSource | None) -> None:
    """Refuse an air of flights that are met in standard air (ConfigError).

    Example:
        >>> from descentflow.densities.checkpoint import load_model
        >>> check_air_asked(load_model("best.ckpt").representation, None)
    """
    if air is not None and representation.air is None:
        raise ConfigError(
            "an air of the flights, for a model whose drag was inferred in standard air",
            expected="a model that was fitted with data.air=measured or a weather field",
            mend="fit such a model, or leave the air out",
        )


def check_standard_air(representation: Representation, what: str) -> None:
    """Refuse a model of drag in measured air where flights are flown in standard air alone (ConfigError).

    Args:
        representation: The model's.
        what: Who refuses, for the message.

    Example:
        >>> from descentflow.densities.checkpoint import load_model
        >>> check_standard_air(load_model("best.ckpt").representation, "a program for a simulator")
    """
    if representation.air is not None:
        raise ConfigError(
            f"{what}, of a model whose drag was inferred in the flights' own air",
            expected="a model that was fitted with data.air=standard: it flies in standard air alone",
            mend="fit such a model, or draw its descents with `descentflow sample`, in any air",
        )


def flown_in(aircraft: PerformanceModel, flown: Trajectories, air: LevelAir) -> Trajectories:
    """Descents that were flown in standard air, at the same CAS and drag in the air of each.

    Rates are exact at levels. The time between two levels is that of standard air, jumps of the rate included, times
    the mean of both levels' ratio of slowness: within 0.05 s of a descent from FL350, for the ratio hardly jumps.

    Args:
        aircraft: Coefficients that flew them; its reference mass is the mass.
        flown: n descents.
        air: Of the n descents, or one for all, on their levels.

    Example:
        >>> from descentflow.densities.checkpoint import load_model
        >>> model = load_model("best.ckpt")
        >>> decoder = model.representation.decoder
        >>> flown = decoder(model.sample(5, seed=0))
        >>> warm = flown_in(decoder.aircraft, flown, LevelAir.uniform(decoder.levels_fl, deviation_k=10.0))
        >>> bool((warm.tas_mps > flown.tas_mps)[flown.mask].all())
        True
    """
    altitude_m = (flown.levels_fl * FL_M).to(flown.cas_mps)
    state = in_air(aircraft, flown.cas_mps, altitude_m, air)
    rate = rate_in_air(aircraft, flown.rate_mps, flown.drag_n, state)
    tas = flown.tas_mps * state.tas_mps / state.standard_tas_mps
    slower = flown.rate_mps / rate
    legs = (flown.time_s[:, :-1] - flown.time_s[:, 1:]) * (slower[:, 1:] + slower[:, :-1]) / 2
    return replace(flown, time_s=summed_from_entry(legs, flown.entry), tas_mps=tas, rate_mps=rate)
