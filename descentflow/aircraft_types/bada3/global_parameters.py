"""BADA's parameters that hold for all types (user manual, section 5; file BADA.GPF)."""

from dataclasses import asdict, dataclass
from math import isfinite
from typing import Any, Final

from descentflow.core.errors import AircraftError


@dataclass(frozen=True)
class GlobalParameters:
    """Parameters of section 5 of the manual for a descent; the defaults are the manual's for civil flights.

    A directory's own BADA.GPF is read by :func:`descentflow.aircraft_types.bada3.bada_directory.read_gpf`.

    Example:
        >>> GlobalParameters().approach_ceiling_ft
        8000.0
    """

    min_speed_factor: float = 1.3
    """C_v,min: minimum speed over stall speed, all phases but take-off (5.7)."""
    approach_ceiling_ft: float = 8000.0
    """H_max,AP: no approach configuration at or above this altitude (5.6)."""
    landing_ceiling_ft: float = 3000.0
    """H_max,LD: no landing configuration at or above this altitude (5.6)."""
    expedited_drag_factor: float = 1.6
    """C_des,exp: drag factor of an expedited descent, flown with spoilers (5.4)."""
    des_increment_kt: tuple[float, float, float, float] = (5.0, 10.0, 20.0, 50.0)
    """V_d,des 1 to 4: speed above the minimum below 1,000, 1,500, 2,000 and 3,000 ft, jets and turboprops (5.8)."""
    des_increment_piston_kt: tuple[float, float, float] = (5.0, 10.0, 20.0)
    """V_d,des 5 to 7: the same below 500, 1,000 and 1,500 ft for pistons (5.8)."""

    @classmethod
    def from_state(cls, state: Any) -> "GlobalParameters":
        """Rebuild from the dictionary of a checkpoint.

        Raises:
            AircraftError: If it is none of global parameters.
        """
        plain = asdict(STANDARD)
        kinds = [_kinds(one) for one in (plain, state)]
        if kinds[0] != kinds[1]:
            raise AircraftError(
                f"global parameters {str(state)[:60]}",
                expected=f"numbers for {', '.join(plain)}",
                mend="take the file as it was written",
            )
        return cls(**state)


STANDARD: Final = GlobalParameters()
"""The manual's values."""


def _kinds(state: Any) -> Any:
    """Of each parameter its name and, of each of its numbers, whether it is finite."""
    if not isinstance(state, dict):
        return None
    parts = {name: value if isinstance(value, tuple) else (value,) for name, value in state.items()}
    return {name: [isinstance(one, float) and isfinite(one) for one in part] for name, part in parts.items()}
