"""The catalogue of effects; each is a small module, and a user's own is an entry more."""

from descentflow.gap.effects.airspeed_bias import AirspeedBias
from descentflow.gap.effects.base import Effect, Parameter, Shift
from descentflow.gap.effects.drag_polar import DragPolar
from descentflow.gap.effects.geometric_path import GeometricPath
from descentflow.gap.effects.idle_thrust import IdleThrust
from descentflow.gap.effects.level_off import LevelOff
from descentflow.gap.effects.mass import Mass
from descentflow.gap.effects.measurement_noise import MeasurementNoise
from descentflow.gap.effects.speed_brake import SpeedBrake
from descentflow.gap.effects.speed_schedule import SpeedSchedule
from descentflow.gap.effects.temperature import Temperature
from descentflow.gap.effects.vertical_rate_lag import VerticalRateLag
from descentflow.gap.effects.vertical_speed_mode import VerticalSpeedMode
from descentflow.gap.effects.wind_gradient import WindGradient

__all__ = ["EFFECTS", "UNKNOWN", "Effect", "Parameter", "Shift"]

EFFECTS: dict[str, Effect] = {
    effect.name: effect
    for effect in (
        Temperature(),
        WindGradient(),
        Mass(),
        IdleThrust(),
        DragPolar(),
        SpeedBrake(),
        GeometricPath(),
        VerticalSpeedMode(),
        LevelOff(),
        SpeedSchedule(),
        AirspeedBias(),
        VerticalRateLag(),
        MeasurementNoise(),
    )
}
"""Every effect by its name."""
UNKNOWN = "unknown"
"""What lies outside the catalogue."""
