"""Causes that a world can inject in its flights, each flown in time: those of the catalogue, and some outside it."""

from descentflow.simulation.causes.aerodynamics import (
    COMPRESSIBILITY,
    DRAG_POLAR,
    IDLE_THRUST,
    KEPT_THRUST,
    MASS,
    SPEED_BRAKE,
    TURN,
)
from descentflow.simulation.causes.air import TEMPERATURE, WIND_GRADIENT
from descentflow.simulation.causes.cause import Cause, Injection
from descentflow.simulation.causes.instruments import AIRSPEED_BIAS, MEASUREMENT_NOISE, VERTICAL_RATE_LAG
from descentflow.simulation.causes.operation import GEOMETRIC_PATH, LEVEL_OFF, SPEED_SCHEDULE, VERTICAL_SPEED_MODE

CATALOGUED = (
    TEMPERATURE,
    WIND_GRADIENT,
    MASS,
    IDLE_THRUST,
    DRAG_POLAR,
    SPEED_BRAKE,
    GEOMETRIC_PATH,
    VERTICAL_SPEED_MODE,
    LEVEL_OFF,
    SPEED_SCHEDULE,
    AIRSPEED_BIAS,
    VERTICAL_RATE_LAG,
    MEASUREMENT_NOISE,
)
"""Causes that a diagnosis should name."""

OUTSIDE = (COMPRESSIBILITY, KEPT_THRUST, TURN)
"""Causes that a diagnosis should call unknown."""

CAUSES: dict[str, Cause] = {cause.name: cause for cause in CATALOGUED + OUTSIDE}
"""Every cause by name."""

__all__ = ["CATALOGUED", "CAUSES", "OUTSIDE", "Cause", "Injection"]
