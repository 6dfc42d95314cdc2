"""Flights whose drag is inferred at the mass that each of them had."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import polars as pl
import torch
from torch import Tensor

from descentflow.air.energy_in_air import in_air
from descentflow.air.level_air import LevelAir
from descentflow.aircraft_types.aircraft import Aircraft
from descentflow.core.errors import ConfigError, DataError
from descentflow.physics.mass_in_drag import drag_at_reference_mass
from descentflow.representation.context_columns import flight_context, read_context_table
from descentflow.representation.kept_mass import KeptMass
from descentflow.representation.profiles import Profiles
from descentflow.representation.representation import Representation, Split

STANDARD = "standard"
LIGHTEST, HEAVIEST = 0.3, 3.0
"""In units of the type's reference mass: beyond these a number is no mass of it in kg, but in tonnes or pounds."""


def masses_of(frame: pl.DataFrame, column: str, table: Path | pl.DataFrame | None = None) -> dict[str, float]:
    """Mass (kg) by flight, of those that have one.

    Args:
        frame: Prepared descents.
        column: Of the table, or of the descents.
        table: Table, or path of a CSV or Parquet table, with ``flight_id`` and the column.

    Raises:
        ConfigError: If there is no such column.
        DataError: If it holds no numbers, or no flight has one.

    Example:
        >>> masses = pl.DataFrame({"flight_id": ["A320-0-00003"], "mass_kg": [61_000.0]})
        >>> masses_of(pl.read_parquet("descents.parquet"), "mass_kg", masses)
        {'A320-0-00003': 61000.0}
    """
    try:
        found = flight_context(frame, [column], read_context_table(table))
    except ConfigError as error:
        raise ConfigError(
            f"mass {column}",
            expected=f"standard, or {error.expected.removeprefix('different ')}",
            mend="change data.mass, or pass a context table with flight_id and the column",
        ) from error
    if not found[column].dtype.is_numeric():
        raise DataError(f"masses in {column} of type {found[column].dtype}", expected="numbers, kg", mend="convert it")
    told = found.with_columns(pl.col(column).cast(pl.Float64)).filter(pl.col(column).is_finite())
    if told.is_empty():
        raise DataError(f"no flight with a mass in {column}", expected="some, kg", mend="fill in the column")
    return dict(told.iter_rows())


def of_known_mass(frame: pl.DataFrame, masses: dict[str, float], say: Callable[[str], None]) -> pl.DataFrame:
    """The descents of flights whose mass is known; ``say`` gets a count of the others.

    Example:
        >>> descents = pl.DataFrame({"flight_id": ["a", "a", "b"], "level_fl": [150, 151, 150]})
        >>> of_known_mass(descents, {"a": 61_000.0}, print)["flight_id"].to_list()
        left out 1 of 2 flight(s) without a mass
        ['a', 'a']
    """
    flights = frame["flight_id"].unique()
    lacking = int((~flights.is_in(list(masses))).sum())
    if not lacking:
        return frame
    say(f"left out {lacking} of {len(flights)} flight(s) without a mass")
    return frame.filter(pl.col("flight_id").is_in(list(masses)))


def with_own_mass(
    profiles: Profiles, aircraft: Aircraft, masses: dict[str, float], say: Callable[[str], None]
) -> Profiles:
    """The flights whose mass is known, with their drag brought to the reference mass.

    Args:
        profiles: Flights whose drag was inferred at the reference mass, in whatever air.
        aircraft: Coefficients that inferred it.
        masses: kg by flight.
        say: Called with a count of the flights without a mass: they are left out.

    Raises:
        DataError: If no flight has a mass, or one is far from any of the type.

    Example:
        >>> from descentflow.aircraft_types.registry import aircraft
        >>> from descentflow.representation.profiles import profiles_from_frame
        >>> a320 = aircraft("A320")
        >>> profiles = profiles_from_frame(pl.read_parquet("descents.parquet"), a320, 150, 340)
        >>> same = with_own_mass(profiles, a320, dict.fromkeys(profiles.flight_ids, a320.mass_reference_kg), print)
        >>> torch.allclose(same.drag_n, profiles.drag_n), len(same.mass_kg)
        (True, 120)
    """
    chosen = profiles.subset([i for i, flight in enumerate(profiles.flight_ids) if flight in masses])
    if len(chosen) < len(profiles):
        say(f"left out {len(profiles) - len(chosen)} of {len(profiles)} flight(s) without a mass")
    if not len(chosen):
        raise DataError("no flight with a mass", expected="a mass in kg for some", mend="fill in the column")
    mass = torch.tensor([masses[flight] for flight in chosen.flight_ids], dtype=torch.float64)
    check_masses(mass, aircraft)
    air = LevelAir.uniform(chosen.levels_fl) if chosen.air is None else chosen.air
    thrust = in_air(aircraft, chosen.cas_mps, chosen.altitude_m, air).thrust_n
    drag = drag_at_reference_mass(aircraft, chosen.drag_n, thrust, chosen.cas_mps, chosen.altitude_m, mass)
    return replace(chosen, drag_n=torch.where(chosen.mask, drag, 0.0), mass_kg=mass)


def kept_masses(column: str, profiles: Profiles, split: Split) -> KeptMass | None:
    """What a model keeps of its training flights' masses; None where they were not looked for.

    Example:
        >>> from descentflow.aircraft_types.registry import aircraft
        >>> from descentflow.representation.profiles import profiles_from_frame
        >>> profiles = profiles_from_frame(pl.read_parquet("descents.parquet"), aircraft("A320"), 150, 340)
        >>> kept_masses("standard", profiles, Split(profiles.flight_ids, (), ())) is None
        True
    """
    if profiles.mass_kg is None:
        return None
    train = set(split.train)
    return KeptMass(column, profiles.mass_kg[[i for i, flight in enumerate(profiles.flight_ids) if flight in train]])


def check_masses(mass_kg: Tensor, aircraft: Aircraft) -> None:
    """Refuse what is no mass of the type in kg.

    Raises:
        DataError: If one is far from any.

    Example:
        >>> from descentflow.aircraft_types.registry import aircraft
        >>> check_masses(torch.tensor([61.0]), aircraft("A320"))
        Traceback (most recent call last):
        descentflow.core.errors.DataError: a mass of 61 kg for the A320; expected ... kg to ... kg; ...
    """
    reference = float(aircraft.mass_reference_kg)
    odd = ~((mass_kg >= LIGHTEST * reference) & (mass_kg <= HEAVIEST * reference))
    if bool(odd.any()):
        raise DataError(
            f"a mass of {float(mass_kg[odd][0]):g} kg for the {aircraft.typecode}",
            expected=f"{LIGHTEST * reference:,.0f} kg to {HEAVIEST * reference:,.0f} kg",
            mend="check the unit: kg",
        )


def check_reference_mass(representation: Representation, what: str) -> None:
    """Refuse a model of drag at each flight's own mass where all are flown at the reference mass (ConfigError).

    Args:
        representation: The model's.
        what: Who refuses, for the message.

    Example:
        >>> from descentflow.representation.read_checkpoint import load_representation
        >>> check_reference_mass(load_representation("best.ckpt"), "a program for a simulator")
    """
    if representation.mass is not None:
        raise ConfigError(
            f"{what}, of a model whose drag was inferred at each flight's own mass",
            expected="a model that was fitted with data.mass=standard: here all fly at the reference mass",
            mend="fit such a model, or draw its descents with `descentflow sample`, at any mass",
        )
