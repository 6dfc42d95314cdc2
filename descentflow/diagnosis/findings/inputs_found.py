"""Inputs of a diagnosis: both sides by name, versions, settings; and channels that could not be used."""

from dataclasses import dataclass, field


@dataclass(frozen=True)
class InputUsed:
    """One side of the comparison.

    Attributes:
        name: File, folder, or what was passed in memory.
        kind: What it is: ``prepared descents``, ``rows``, ``checkpoint``, ``nominal BADA`` and the like.
        flights: Flights in it; 0 for nominal BADA, which has none.
        aircraft: Airframes that flew them; None where not known.
        first: Day of the first flight (ISO 8601); None where not known.
        last: Day of the last one.
        typecodes: Aircraft types.
        version: Version of descentflow that prepared the flights; None where not known.
        settings: Cleaning settings by name, as text; empty where not known.
        files: Names of the files of rows behind the flights.
        fingerprint: SHA-256 of the flights, or of a checkpoint's weights; None where there are none.
        derived: Flights whose airspeeds were made by a weather field.

    Example:
        >>> InputUsed("rows.parquet", "rows", 400, 80, "2026-10-01", "2026-10-31", ["A320"]).flights
        400
    """

    name: str = ""
    kind: str = ""
    flights: int = 0
    aircraft: int | None = None
    first: str | None = None
    last: str | None = None
    typecodes: list[str] = field(default_factory=list)
    version: str | None = None
    settings: dict[str, str] = field(default_factory=dict)
    files: list[str] = field(default_factory=list)
    fingerprint: str | None = None
    derived: int = 0


@dataclass(frozen=True)
class CoefficientsUsed:
    """Type whose coefficients gave the signatures of effects.

    Attributes:
        typecode: Type of the coefficients.
        source: Where they come from.
        of_flights: Types of the flights.
        nearest: Whether they were taken as the nearest to a type that has none.
        asked: That type, where another than the flights' was asked for.

    Example:
        >>> print(CoefficientsUsed("B772", "open aircraft", ["B788"], nearest=True))
        Signatures are those of the B772's coefficients, the nearest that there are to the B788.
        >>> print(CoefficientsUsed("E190", "open aircraft", ["A320"], nearest=True, asked="GLF6"))
        Signatures are those of the E190's coefficients, the nearest that there are to the GLF6, which stand for the \
A320.
    """

    typecode: str
    source: str
    of_flights: list[str]
    nearest: bool = False
    asked: str | None = None

    @property
    def stand_in(self) -> bool:
        """True if they are another type's than the flights'."""
        return bool(self.of_flights) and self.of_flights != [self.typecode]

    def __str__(self) -> str:
        """For readers."""
        said = f"Signatures are those of the {self.typecode}'s coefficients"
        flights = ", ".join(self.of_flights)
        if self.nearest:
            said += f", the nearest that there are to the {self.asked or flights}"
        if self.stand_in and (self.asked or not self.nearest):
            said += f", which stand for the {flights}"
        return f"{said}."


@dataclass(frozen=True)
class Provenance:
    """Inputs by which the answer can be made again.

    Attributes:
        real: The flights.
        simulator: What they were compared with.
        versions: Version of descentflow and of what else decides numbers, by name.
        settings: Settings, by name, as text.
        user_files: Files of the user's own code that were run (``--catalogue``).
        coefficients: Whose coefficients gave the signatures, for a simulator that is given by its flights and for
            flights of any type.

    Example:
        >>> one = InputUsed("rows.parquet", "rows", 400)
        >>> Provenance(one, InputUsed("best.ckpt", "checkpoint", 300), {"descentflow": "0.1"}).user_files
        []
    """

    real: InputUsed = InputUsed()
    simulator: InputUsed = InputUsed()
    versions: dict[str, str] = field(default_factory=dict)
    settings: dict[str, str] = field(default_factory=dict)
    user_files: list[str] = field(default_factory=list)
    coefficients: CoefficientsUsed | None = None


@dataclass(frozen=True)
class LeftOutChannel:
    """A channel that one side lacks and that was left out of both.

    Attributes:
        channel: Its name.
        lacking: Side that lacks it: ``simulator`` or ``real``.
        would_separate: Effects that it would have separated.

    Example:
        >>> print(LeftOutChannel("TAS", "simulator", ["temperature", "wind_gradient"]))
        TAS is left out: the simulator's flights lack it
    """

    channel: str
    lacking: str
    would_separate: list[str] = field(default_factory=list)

    def __str__(self) -> str:
        """For readers."""
        side = "the simulator's flights" if self.lacking == "simulator" else "the real flights"
        return f"{self.channel} is left out: {side} lack it"


@dataclass(frozen=True)
class FlightWorthALook:
    """A flight that shows most of what no named cause explains.

    Attributes:
        flight: Its identifier in the prepared descents.
        excess: What it shows beyond the simulator and the named causes, in ``unit``.
        unit: Of ``excess``.
        quantity: Name of the quantity, see :data:`descentflow.measurements.quantity_registry.QUANTITIES`, or ``time``.
        low_fl: Lower end of the levels where it shows most.
        high_fl: Upper end.

    Example:
        >>> FlightWorthALook("DLH4AB-3", 41.0, "s", "time", 190.0, 235.0).flight
        'DLH4AB-3'
    """

    flight: str
    excess: float
    unit: str
    quantity: str
    low_fl: float
    high_fl: float
