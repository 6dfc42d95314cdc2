"""Columns of samples and of flights: their units, also as other formats write them, and their meaning."""

from dataclasses import dataclass

from descentflow.core.files import table_beside

UDUNITS = {"kt": "knot", "NM": "nautical_mile", "degrees": "degree"}
"""Unit -> how UDUNITS writes it, where that is otherwise."""


@dataclass(frozen=True)
class SampleColumn:
    """One column: unit, meaning, and standard name of the CF conventions if there is one.

    Example:
        >>> COLUMNS["CAS"].unit, COLUMNS["CAS"].udunit, COLUMNS["TAS"].standard_name
        ('kt', 'knot', 'platform_speed_wrt_air')
    """

    unit: str
    meaning: str
    standard_name: str | None = None

    @property
    def udunit(self) -> str:
        """The unit in the writing of UDUNITS."""
        return UDUNITS.get(self.unit, self.unit)


COLUMNS = {name: SampleColumn(**column) for name, column in table_beside(__file__).items()}
"""Every column of samples and of flights; temperature and wind stand where samples have their own."""
FUEL = ("thrust_n", "fuel_flow_kg_s", "fuel_kg", "co2_kg")
"""Columns that are there where one model flew the samples."""
