"""Every cause, in the order in which they act."""

from descentflow.simulation.causes.aerodynamics import DRAG_POLAR, IDLE_THRUST, INDUCED_DRAG, MASS, SPEED_BRAKE
from descentflow.simulation.causes.air import TEMPERATURE, WIND_GRADIENT
from descentflow.simulation.causes.cause import Cause
from descentflow.simulation.causes.instruments import AIRSPEED_BIAS, MEASUREMENT_NOISE, VERTICAL_RATE_LAG
from descentflow.simulation.causes.operation import GEOMETRIC_PATH, LEVEL_OFF, SPEED_SCHEDULE, VERTICAL_SPEED_MODE
from descentflow.simulation.causes.unmodelled_forces import (
    ANTI_ICE,
    COMPRESSIBILITY,
    KEPT_THRUST,
    POWERED_DESCENT,
    TURN,
)

CATALOGUED = (
    TEMPERATURE,
    WIND_GRADIENT,
    MASS,
    IDLE_THRUST,
    DRAG_POLAR,
    SPEED_BRAKE,
    TURN,
    GEOMETRIC_PATH,
    VERTICAL_SPEED_MODE,
    LEVEL_OFF,
    SPEED_SCHEDULE,
    AIRSPEED_BIAS,
    VERTICAL_RATE_LAG,
    MEASUREMENT_NOISE,
)
"""Causes that a diagnosis should name, if channels show them."""

OUTSIDE = (COMPRESSIBILITY, KEPT_THRUST, ANTI_ICE)
"""Causes that a diagnosis should call unknown."""

BETWEEN = (INDUCED_DRAG, POWERED_DESCENT)
"""Causes that come so near to one of the catalogue that either answer is right: a polar of the wrong shape is nearly
another mass, and thrust all the way down nearly less drag."""

_HELD_LAST = (GEOMETRIC_PATH, VERTICAL_SPEED_MODE)
_FIRST = tuple(cause for cause in (*CATALOGUED, *OUTSIDE, *BETWEEN) if cause not in _HELD_LAST)
CAUSES: dict[str, Cause] = {cause.name: cause for cause in (*_FIRST, *_HELD_LAST)}
"""Every cause by name, in the order in which they act: a path or a rate is planned for the speeds, the drag and the air
that the flight really meets."""
