"""Effects: physical and operational causes that may set flights and a simulator apart, a file each.

Read :mod:`~descentflow.effects.effect` (what an effect is), then any of them;
:mod:`~descentflow.effects.flight_state` is what they look at.

To add an effect: write its file here and enter it in ``EFFECTS`` below; without a change to the package, pass a
catalogue with it to :func:`descentflow.diagnosis.diagnose.diagnose`.
"""

from descentflow.effects._catalogue_check import checked_catalogue
from descentflow.effects.airspeed_bias import AirspeedBias
from descentflow.effects.drag_polar import DragPolar
from descentflow.effects.effect import Effect, FlightChange, Parameter, Shift
from descentflow.effects.geometric_path import GeometricPath
from descentflow.effects.idle_thrust import IdleThrust
from descentflow.effects.level_off import LevelOff
from descentflow.effects.mass import Mass
from descentflow.effects.speed_brake import SpeedBrake
from descentflow.effects.speed_schedule import SpeedSchedule
from descentflow.effects.temperature import Temperature
from descentflow.effects.turn import Turn
from descentflow.effects.vertical_rate_lag import VerticalRateLag
from descentflow.effects.vertical_speed_mode import VerticalSpeedMode
from descentflow.effects.wind_gradient import WindGradient

__all__ = ["EFFECTS", "UNKNOWN", "Effect", "FlightChange", "Parameter", "Shift", "checked_catalogue"]

EFFECTS: dict[str, Effect] = {
    effect.name: effect
    for effect in (
        Temperature(),
        WindGradient(),
        Mass(),
        IdleThrust(),
        DragPolar(),
        SpeedBrake(),
        Turn(),
        GeometricPath(),
        VerticalSpeedMode(),
        LevelOff(),
        SpeedSchedule(),
        AirspeedBias(),
        VerticalRateLag(),
    )
}
"""Every effect by its name."""
UNKNOWN = "unknown"
"""Cause outside the catalogue."""
