"""Effects that no comparison with a simulator of the same flights can show."""

from descentflow.diagnosis.diagnosis_settings import Settings
from descentflow.diagnosis.findings.gap_found import WouldSplit

OWN_FLIGHTS = ("training flights", "samples")
"""Sources that hold a model's own flights, whose causes its inferred drag holds as well; flights of any simulator are
what it flies, and what both sides have alike is no gap."""


def not_identifiable(settings: Settings, source: str) -> list[WouldSplit]:
    """Effects that a simulator's flights hide, by their origin.

    Example:
        >>> from descentflow.aircraft_types.registry import aircraft
        >>> from descentflow.diagnosis.simulator import Simulator
        >>> from descentflow.effects import EFFECTS
        >>> asked = Settings(Simulator(aircraft("A320")), EFFECTS, [], 0, str)
        >>> "mass" in not_identifiable(asked, "training flights")[0].between, not_identifiable(asked, "simulator")
        (True, [])
    """
    if source not in OWN_FLIGHTS:
        return []
    names = [name for name, effect in settings.catalogue.items() if effect.inherited_from is None]
    why = "not identifiable where the simulator's own flights have them as well"
    return [WouldSplit(names, [], why)]
