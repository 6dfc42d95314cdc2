"""A simulator that is given by its flights, whoever wrote it: types of both sides, and whose coefficients to take."""

from dataclasses import dataclass
from pathlib import Path

import polars as pl

from descentflow.aircraft_types.nearest_type import nearest_type
from descentflow.aircraft_types.registry import aircraft as find_aircraft
from descentflow.core.errors import ConfigError, DataError, UnknownTypeError
from descentflow.diagnosis.findings.inputs_found import CoefficientsUsed
from descentflow.diagnosis.simulator import Simulator
from descentflow.physics.performance_model import PerformanceModel


@dataclass(frozen=True)
class SignatureSource:
    """Type whose coefficients give the signatures of effects.

    Attributes:
        typecode: A type; the flights' own if None.
        bada_dir: Folder of BADA files; the embedded open aircraft if None.
        nearest: Whether the nearest type may stand for one that has no coefficients.

    Example:
        >>> SignatureSource(nearest=True).coefficients(["B788"])[1].typecode
        'B772'
    """

    typecode: str | None = None
    bada_dir: str | Path | None = None
    nearest: bool = False

    def coefficients(self, of_flights: list[str]) -> tuple[PerformanceModel, CoefficientsUsed]:
        """Coefficients for flights of some types, and what to say of them.

        Args:
            of_flights: Types of the flights.

        Raises:
            AircraftError: If the type has no coefficients, and the nearest is not asked for or not known, or its files
                cannot be read.
            DataError: If the flights are of several types or of none, and no coefficients are chosen.
        """
        own = self.typecode or _one(of_flights)
        try:
            found = find_aircraft(own, self.bada_dir)
        except UnknownTypeError as error:
            if not self.nearest:
                raise UnknownTypeError(
                    error.got,
                    expected=f"coefficients that give the signatures of effects, {error.expected}",
                    mend="name a type whose coefficients stand for it (--typecode), or let the nearest be taken "
                    "(--nearest-type)",
                ) from error
            found = nearest_type(own, self.bada_dir)
        nearest = self.nearest and found.typecode != own
        asked = own if nearest and of_flights != [own] else None
        return found, CoefficientsUsed(found.typecode, found.source, of_flights, nearest, asked)


@dataclass(frozen=True)
class SidesOfOneType:
    """Flights of both sides that are of the same types.

    Attributes:
        real: Prepared real descents.
        simulator: Prepared descents of the simulator.
        typecodes: Their types, sorted.
        dropped: Flights of other types, by side.

    Example:
        >>> frame = pl.read_parquet("descents.parquet")
        >>> of_one_type(frame, frame).typecodes
        ['A320']
    """

    real: pl.DataFrame
    simulator: pl.DataFrame
    typecodes: list[str]
    dropped: dict[str, int]


def of_one_type(real: pl.DataFrame, simulator: pl.DataFrame) -> SidesOfOneType:
    """Flights of the types that both sides have; a side that names no type is taken to be of the other's.

    Raises:
        DataError: If the two have no type in common.

    Example:
        >>> frame = pl.read_parquet("descents.parquet")
        >>> of_one_type(frame, frame.with_columns(typecode=pl.lit("B738")))
        Traceback (most recent call last):
        descentflow.core.errors.DataError: real flights of A320 and a simulator's flights of B738; ...
    """
    first, second = types_of(real), types_of(simulator)
    if not first or not second:
        return SidesOfOneType(real, simulator, first or second, {})
    both = sorted(set(first) & set(second))
    if not both:
        raise DataError(
            f"real flights of {', '.join(first)} and a simulator's flights of {', '.join(second)}",
            expected="flights of one type on both sides",
            mend="prepare the rows of one type (descentflow prepare --typecode), or name the types alike",
        )
    kept = [frame.filter(pl.col("typecode").is_in(both)) for frame in (real, simulator)]
    dropped = {
        name: before["flight_id"].n_unique() - after["flight_id"].n_unique()
        for name, before, after in zip(
            ("flights_of_other_types", "simulator_flights_of_other_types"), (real, simulator), kept, strict=True
        )
    }
    return SidesOfOneType(kept[0], kept[1], both, {name: number for name, number in dropped.items() if number})


def types_of(frame: pl.DataFrame) -> list[str]:
    """Types that prepared descents name, sorted.

    Example:
        >>> types_of(pl.read_parquet("descents.parquet"))
        ['A320']
    """
    return sorted(frame["typecode"].drop_nulls().cast(pl.String).unique().to_list()) if "typecode" in frame else []


def simulator_of_flights(frame: pl.DataFrame, typecodes: list[str], source: SignatureSource, name: str) -> Simulator:
    """The simulator that flew these descents.

    Args:
        frame: Prepared descents.
        typecodes: Their types.
        source: Whose coefficients give the signatures.
        name: Of the file or folder.

    Raises:
        AircraftError: As :meth:`SignatureSource.coefficients`.
        DataError: As :meth:`SignatureSource.coefficients`.

    Example:
        >>> simulator_of_flights(pl.read_parquet("descents.parquet"), ["A320"], SignatureSource(), "descents.parquet")
        Simulator(... name='descents.parquet', flights=shape: ...)
    """
    aircraft, used = source.coefficients(typecodes)
    return Simulator(aircraft, name=name, flights=frame, coefficients=used)


def check_no_source(source: SignatureSource, kind: str) -> None:
    """Refuse a type, or the wish for the nearest, beside a simulator that has coefficients (ConfigError).

    Example:
        >>> check_no_source(SignatureSource(typecode="A320"), "a checkpoint")
        Traceback (most recent call last):
        descentflow.core.errors.ConfigError: a type whose coefficients are to be taken, beside a checkpoint; ...
    """
    if source.typecode is None and not source.nearest:
        return
    asked = "a type whose coefficients are to be taken" if source.typecode is not None else "the nearest type"
    raise ConfigError(
        f"{asked}, beside {kind}",
        expected="it beside a simulator's flights, for a checkpoint and a type have coefficients of their own",
        mend="leave it out",
    )


def _one(typecodes: list[str]) -> str:
    if len(typecodes) == 1:
        return typecodes[0]
    got = f"flights of {', '.join(typecodes)}" if typecodes else "flights that name no type"
    raise DataError(
        f"{got}, and no word whose coefficients give the signatures of effects",
        expected="flights of one type, or the type whose coefficients stand for them",
        mend="name it (--typecode A320), or prepare the rows of one type",
    )
