"""The aircraft models of JSBSim's wheel that are flown, and what they are flown at."""

from dataclasses import dataclass

from descentflow.core.errors import ConfigError

WITHHELD = ("737", "A320")
"""Models of the wheel that are not flown here: they are kept for others to judge with."""


@dataclass(frozen=True)
class Airframe:
    """One model: its numbers that the autopilot and the effects need, and the range of its flights.

    Example:
        >>> AIRFRAMES["B747"].typecode, AIRFRAMES["B747"].reference  # flown as a B744 by a user of the open A388
        ('B744', 'A388')
    """

    name: str
    """Folder and file of the model in JSBSim's wheel."""
    typecode: str
    """ICAO designator of the aircraft that is modelled."""
    reference: str
    """Type whose open coefficients a user without this type's would take."""
    mass_kg: tuple[float, float]
    """Lightest and heaviest mass at the start of a flight, up to the largest landing mass; the model's own empty mass
    is the lower bound where it is larger than the aircraft's."""
    mach: float
    """Planned Mach number; operators differ by 0.01."""
    cas_kt: tuple[float, float, float]
    """Planned CAS of the three operators."""
    tops_fl: tuple[float, float]
    """Lowest and highest entry level, flown in steps of 1,000 ft."""
    zero_lift_drag: float
    """The model's own drag coefficient at no lift and small angles of attack."""
    brake_drag: float
    """Drag coefficient that its speed brakes add when they are fully out."""
    elevator_rad: tuple[float, float]
    """Range of the elevator, nose up (negative) and nose down; the T38's model moves shares of it, and no angles."""
    rated_n: float
    """Static thrust of all engines."""
    step_s: float = 0.1
    """Longest step of the integration that flies it as a tenth of a second does; the 787's pitch, 3 rad/s, is fast."""


_LBF_N = 4.4482216152605
AIRFRAMES = {
    airframe.name: airframe
    for airframe in (
        Airframe(
            name="787-8",
            typecode="B788",
            reference="B772",
            mass_kg=(142e3, 172e3),
            mach=0.83,
            cas_kt=(280, 295, 310),
            tops_fl=(350, 390),
            zero_lift_drag=0.015,
            brake_drag=0.07,
            elevator_rad=(-0.35, 0.35),
            rated_n=2 * 66_500 * _LBF_N,
        ),
        Airframe(
            name="MD11",
            typecode="MD11",
            reference="B772",
            mass_kg=(176e3, 205e3),
            mach=0.82,
            cas_kt=(280, 295, 310),
            tops_fl=(350, 380),
            zero_lift_drag=0.019,
            brake_drag=0.019,
            elevator_rad=(-0.35, 0.3),
            rated_n=3 * 60_200 * _LBF_N,
            step_s=0.2,
        ),
        Airframe(
            name="B747",
            typecode="B744",
            reference="A388",
            mass_kg=(244e3, 285e3),
            mach=0.84,
            cas_kt=(280, 295, 310),
            tops_fl=(350, 380),
            zero_lift_drag=0.017,
            brake_drag=0.017,
            elevator_rad=(-0.35, 0.175),
            rated_n=4 * 58_000 * _LBF_N,
            step_s=0.2,
        ),
        Airframe(
            name="global5000",
            typecode="GL5T",
            reference="F2TH",
            mass_kg=(27.5e3, 35e3),
            mach=0.80,
            cas_kt=(270, 285, 300),
            tops_fl=(350, 390),
            zero_lift_drag=0.024,
            brake_drag=0.02,
            elevator_rad=(-0.35, 0.35),
            rated_n=2 * 15_000 * _LBF_N,
        ),
        Airframe(
            name="fokker100",
            typecode="F100",
            reference="E190",
            mass_kg=(29e3, 39.9e3),
            mach=0.72,
            cas_kt=(260, 275, 290),
            tops_fl=(310, 350),
            zero_lift_drag=0.0192,
            brake_drag=0.12,
            elevator_rad=(-0.35, 0.35),
            rated_n=2 * 13_850 * _LBF_N,
        ),
        Airframe(
            name="T38",
            typecode="T38",
            reference="C56X",
            mass_kg=(3.9e3, 5.2e3),
            mach=0.80,
            cas_kt=(270, 285, 300),
            tops_fl=(350, 390),
            zero_lift_drag=0.016,
            brake_drag=0.025,
            elevator_rad=(-1.0, 0.583),
            rated_n=2 * 2_050 * _LBF_N,
        ),
    )
}
"""Models by name."""


def airframe_of(name: str) -> Airframe:
    """Return the model of a name.

    Args:
        name: Name of a key of :data:`AIRFRAMES`.

    Raises:
        ConfigError: If there is no such model, or it is withheld.

    Example:
        >>> airframe_of("MD11").reference
        'B772'
    """
    if name in AIRFRAMES:
        return AIRFRAMES[name]
    raise ConfigError(
        f"the JSBSim model {name!r}" + (", which is kept for others to judge with" if name in WITHHELD else ""),
        expected=f"one of {', '.join(AIRFRAMES)}",
        mend="choose one of these models",
    )
