"""Inputs of a diagnosis, opened: real flights and a simulator in any form, compared by the same means.

A simulator is a checkpoint or model, flights in any form, or the nominal descent of a type. Real flights go through the
same cleaning as its flights. That a model descends as flights do from which it learnt is no proof of it: such flights
are counted. A model that knows the air of its flights is compared in standard air.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import polars as pl

from descentflow.aircraft_types.nearest_type import nearest_type
from descentflow.aircraft_types.registry import aircraft as find_aircraft
from descentflow.core.errors import ConfigError, DataError, UnknownTypeError, warn
from descentflow.core.version import __version__
from descentflow.diagnosis.findings.findings import SEEN
from descentflow.diagnosis.findings.inputs_found import CoefficientsUsed, InputUsed, Provenance
from descentflow.diagnosis.sides.input_descriptions import input_of_flights, input_of_model, rows_dropped
from descentflow.diagnosis.sides.simulator import FLIGHTS, MODEL, TYPE, Simulator, kind_of_simulator, types_of
from descentflow.physics.performance_model import PerformanceModel
from descentflow.surveillance.descents.prepared_descents import Descents
from descentflow.surveillance.open_descents import FlightSource, paths_of

if TYPE_CHECKING:
    from descentflow.representation.own_air import AirSource
    from descentflow.representation.representation import Representation

OWN = "it next to a simulator's flights, for a checkpoint and a type have coefficients of their own"
MISPLACED = (
    (
        "air",
        (FLIGHTS, TYPE),
        "an air of the flights, for a simulator that is no model of drag in its flights' own air",
        "a checkpoint that was fitted with data.air=measured or a weather field",
        "leave the air out",
    ),
    (
        "simulator_columns",
        (MODEL, TYPE),
        "columns of a simulator that is not given as flights",
        "them for rows of its flights",
        "leave them out; columns of the real rows are `columns` (--column)",
    ),
    ("typecode", (MODEL, TYPE), "a type whose coefficients are to be taken, next to {kind}", OWN, "leave it out"),
    ("nearest_type", (MODEL, TYPE), "the nearest type, next to {kind}", OWN, "leave it out"),
    (
        "bada_dir",
        (MODEL,),
        "BADA files for a simulator that has its own coefficients",
        "them with the designator of a type, or with a simulator's flights",
        "name the type, or leave the folder out",
    ),
)
"""Inputs that do not go with some kinds of simulators: name, kinds, and the error."""


@dataclass(frozen=True)
class Opened:
    """Opened inputs of a diagnosis.

    Attributes:
        frame: Prepared real descents.
        simulator: What is diagnosed.
        real_input: Where the former come from.
        simulator_input: Where the simulator comes from.
        dropped: Flights and rows that were left out, by reason.

    Example:
        >>> Inputs("rows.parquet", "best.ckpt").open().simulator.name
        'best.ckpt'
    """

    frame: pl.DataFrame
    simulator: Simulator
    real_input: InputUsed
    simulator_input: InputUsed
    dropped: Mapping[str, int]

    def provenance(self, settings: dict[str, str], user_files: list[str]) -> Provenance:
        """Inputs by which the answer can be made again, with the settings of the diagnosis and the user's files."""
        versions, coefficients = {"descentflow": __version__}, self.simulator.coefficients
        return Provenance(self.real_input, self.simulator_input, versions, settings, user_files, coefficients)


@dataclass(frozen=True)
class Inputs:
    """Inputs of a diagnosis as a user gives them.

    Attributes:
        real: As :func:`~descentflow.diagnosis.diagnose.diagnose` takes it.
        simulator: The same; None for the nominal descent of ``typecode``.
        typecode: Type whose coefficients give the signatures of effects; the flights' own if None.
        bada_dir: Folder of BADA files; the embedded open aircraft if None.
        nearest_type: Whether the nearest type may stand for one that has no coefficients.
        any_type: Whether real flights of other types than a checkpoint's or a nominal descent's are taken too; if not,
            they are left out and counted.
        air: Where the real flights' air is known from, for a model that knows the air of its own.
        columns: Name in a row -> column of the real rows' tables.
        simulator_columns: The same of the simulator's rows.
        progress: Called with what is being done.

    Example:
        >>> opened = Inputs("rows.parquet", "descents.parquet").open()
        >>> [(side.name, side.flights) for side in (opened.real_input, opened.simulator_input)]
        [('rows.parquet', 120), ('descents.parquet', 120)]
    """

    real: Any
    simulator: Any = None
    typecode: str | None = None
    bada_dir: str | Path | None = None
    nearest_type: bool = False
    any_type: bool = False
    air: "AirSource | None" = None
    columns: Mapping[str, str] | None = None
    simulator_columns: Mapping[str, str] | None = None
    progress: Callable[[str], None] = lambda _: None

    def open(self) -> Opened:
        """Open real flights and the simulator that they are compared with.

        Raises:
            AircraftError: If a type has no coefficients.
            CheckpointError: If a checkpoint cannot be read.
            ConfigError: If inputs contradict each other, or a checkpoint is corrected already.
            DataError: If flights cannot be read, or both sides are of different types.

        Warns:
            DescentflowWarning: If flights of other types are left out, a checkpoint knows the air of its flights, which
                is then taken out of both sides, or most of the real flights are its own.
        """
        if self.simulator is None and self.typecode is None:
            raise ConfigError(
                "neither a simulator nor a type",
                expected="at least one of them",
                mend="pass a checkpoint, a model, a simulator's flights, or the designator of a type for nominal BADA",
            )
        if self.simulator is None:
            # Of BADA 4 the name of a model stands for a type, and is no designator.
            return replace(self, simulator=find_aircraft(str(self.typecode), self.bada_dir), typecode=None).open()
        kind = kind_of_simulator(self.simulator, self.bada_dir)
        self._refuse(kind)
        return {TYPE: self._nominal, FLIGHTS: self._with_flights, MODEL: self._with_model}[kind]()

    def _refuse(self, kind: str) -> None:
        """Refuse what does not go with a kind of simulator (ConfigError)."""
        for name, kinds, got, expected, mend in MISPLACED:
            if kind in kinds and getattr(self, name) not in (None, False, {}):
                raise ConfigError(got.format(kind=kind), expected=expected, mend=mend)

    def _nominal(self) -> Opened:
        of_type = isinstance(self.simulator, PerformanceModel)
        aircraft = self.simulator if of_type else find_aircraft(str(self.simulator), self.bada_dir)
        self.progress("reading flights")
        source = FlightSource(self.real, self.columns, self.progress)
        descents = source.descents()
        frame, simulator, others = self._of_its_type(descents, Simulator(aircraft))
        nominal = InputUsed(f"nominal {aircraft.typecode}", "nominal BADA", 0, typecodes=[aircraft.typecode])
        dropped = {**rows_dropped(descents), **others}
        return Opened(frame, simulator, input_of_flights(source.name, descents), nominal, dropped)

    def _with_flights(self) -> Opened:
        self.progress("reading flights")
        sources = [
            FlightSource(given, columns, self.progress)
            for given, columns in ((self.real, self.columns), (self.simulator, self.simulator_columns))
        ]
        sides = sources[0].beside(sources[1])
        frames, types = [side.reported for side in sides], [types_of(side.reported) for side in sides]
        known, dropped = types[0] or types[1], {}
        if all(types):
            known = sorted(set(types[0]) & set(types[1]))
            if not known:
                raise DataError(
                    f"real flights of {', '.join(types[0])} and a simulator's flights of {', '.join(types[1])}",
                    expected="flights of one type on both sides",
                    mend="prepare the rows of one type (descentflow prepare --typecode), or name the types alike",
                )
            kept = [frame.filter(pl.col("typecode").is_in(known)) for frame in frames]
            names = ("flights_of_other_types", "simulator_flights_of_other_types")
            counts = [a["flight_id"].n_unique() - b["flight_id"].n_unique() for a, b in zip(frames, kept, strict=True)]
            frames, dropped = kept, {name: count for name, count in zip(names, counts, strict=True) if count}
        aircraft, used = self._coefficients(known)
        flights = Descents(frames[1], sides[1].metadata)
        simulator = Simulator(aircraft, sources[1].name, flights, coefficients=used)
        inputs = [input_of_flights(source.name, side) for source, side in zip(sources, sides, strict=True)]
        dropped = {**rows_dropped(sides[0]), **rows_dropped(sides[1], "simulator_rows"), **dropped}
        return Opened(frames[0], simulator, inputs[0], inputs[1], dropped)

    def _with_model(self) -> Opened:
        # Here and not above: a comparison of flights with flights must not pay for models.
        from descentflow.densities.checkpoint import as_density

        density, path = as_density(self.simulator), next(iter(paths_of(self.simulator)), None)
        parts, name = density.representation, type(density).__name__ if path is None else path.name
        simulator = Simulator(parts.decoder.aircraft, name, model=density, path=path)
        if parts.n_context:
            # What flights were given is not among what is compared.
            raise ConfigError(
                "a simulator that is given a context", expected="one that is not", mend="fit it without data.context"
            )
        if parts.correction is not None:
            raise ConfigError(
                f"{name}, a simulator that is corrected already: the flights that it carries are those before",
                expected="the checkpoint that `descentflow fit` wrote, or flights",
                mend="diagnose what it flies: corrected.parquet next to it, or samples (descentflow sample) as "
                "--simulator",
            )
        self.progress("reading flights")
        source = FlightSource(self.real, self.columns, self.progress)
        descents = source.for_model(parts.cleaning, float(parts.decoder.levels_fl[0]))
        frame, simulator, dropped = self._of_its_type(descents, simulator)
        frame, unknown = without_weather(frame, parts, self.air)
        if self.air is not None or parts.air is not None:
            warn(
                f"{name} knows the air of its flights: both sides are compared in standard air, each flight "
                "brought there by its own temperature and wind, so that the weather is none of the causes"
                + (f"; {unknown:,} real flights of whose air nothing is known are left out" if unknown else "")
            )
        dropped |= {"flights_of_unknown_air": unknown} if unknown else {}
        dropped |= _own_flights(frame, name, parts)
        inputs = input_of_flights(source.name, descents), input_of_model(simulator, parts)
        return Opened(frame, simulator, *inputs, {**rows_dropped(descents), **dropped})

    def _of_its_type(self, descents: Descents, simulator: Simulator) -> tuple[pl.DataFrame, Simulator, dict[str, int]]:
        """Real flights of the simulator's type, or any, and the counts of others."""
        if self.any_type:
            # Those that are compared, for the page to call them by.
            types, aircraft = types_of(descents.reported), simulator.aircraft
            used = CoefficientsUsed(aircraft.typecode, aircraft.source, types)
            return descents.reported, replace(simulator, coefficients=used), {}
        frame, others = simulator.of_its_type(descents.reported)
        if others:
            left_out = ", ".join(f"{number:,} of {name.rpartition('_')[2]}" for name, number in others.items())
            warn(f"flights of other types are left out: {left_out}; --any-type (any_type=True) takes them too")
        return frame, simulator, others

    def _coefficients(self, of_flights: list[str]) -> tuple[PerformanceModel, CoefficientsUsed]:
        """Coefficients for flights of some types, and what to say of them."""
        if self.typecode is None and len(of_flights) != 1:
            got = f"flights of {', '.join(of_flights)}" if of_flights else "flights that name no type"
            raise DataError(
                f"{got}, and no word whose coefficients give the signatures of effects",
                expected="flights of one type, or the type whose coefficients stand for them",
                mend="name it (--typecode A320), or prepare the rows of one type",
            )
        own = self.typecode or of_flights[0]
        try:
            aircraft = find_aircraft(own, self.bada_dir)
        except UnknownTypeError as error:
            if not self.nearest_type:
                raise UnknownTypeError(
                    error.got,
                    expected=f"coefficients that give the signatures of effects, {error.expected}",
                    mend="name a type whose coefficients stand for it (--typecode), or let the nearest be taken "
                    "(--nearest-type)",
                ) from error
            aircraft = nearest_type(own, self.bada_dir)
        nearest = self.nearest_type and aircraft.typecode != own
        asked = own if nearest and of_flights != [own] else None
        return aircraft, CoefficientsUsed(aircraft.typecode, aircraft.source, of_flights, nearest, asked)


def without_weather(
    frame: pl.DataFrame, parts: "Representation", air: "AirSource | None" = None
) -> tuple[pl.DataFrame, int]:
    """Real flights in standard air, and how many were left out because nothing is known of their air.

    The training flights that a checkpoint carries were brought there likewise, each by its own temperature and wind:
    the comparison is the one of the simulator flown in the real flights' own airs.

    Args:
        frame: Prepared descents.
        parts: Of a model; of drag in standard air, nothing is changed.
        air: Where the flights' air is known from, see :func:`~descentflow.representation.own_air.airs_as_kept`.

    Raises:
        ConfigError: If the model's air came from a weather field and none is given, or one is given to a model of drag
            in standard air.
        DataError: If nothing is known of the air of any flight.

    Example:
        >>> from descentflow.densities.checkpoint import load_model
        >>> frame = pl.read_parquet("descents.parquet")
        >>> without_weather(frame, load_model("best.ckpt").representation)[1]
        0
    """
    from descentflow.air.standard_air import in_standard_air
    from descentflow.representation.own_air import airs_as_kept, check_air_asked

    check_air_asked(parts, air)
    if parts.air is None:
        return frame, 0
    levels_fl = parts.decoder.levels_fl.cpu()
    airs = airs_as_kept(frame, levels_fl, parts.air, air)
    still = in_standard_air(frame, parts.decoder.aircraft, airs, levels_fl)
    if still.is_empty():
        raise DataError(
            f"none of {airs.without} flights reports its air",
            expected="flights with TAS and groundspeed, for a model of drag in measured air",
            mend="give such flights, or diagnose a model that was fitted with data.air=standard",
        )
    return still, airs.without


def _own_flights(real: pl.DataFrame, name: str, parts: "Representation") -> dict[str, int]:
    """Count the real flights that a checkpoint was trained or validated on; warn if they are most.

    Recognised by aircraft and time: flights of a simulator that flew the same traffic again are not the real ones,
    though both may have the same identifiers.
    """
    count, total = len(parts.seen.among(real)), real["flight_id"].n_unique()
    if 2 * count > total:
        warn(
            f"{count:,} of the {total:,} real flights are some that {name} was trained or validated on, and are no "
            "test of it; to learn how it descends with flights that it has not seen, pass others"
        )
    return {SEEN: count} if count else {}
