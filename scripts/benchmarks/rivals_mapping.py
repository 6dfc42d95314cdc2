"""Effects of the catalogue for which a rival's names stand."""

SPEEDS_KEPT = frozenset(
    {"mass", "idle_thrust", "drag_polar", "speed_brake", "turn", "geometric_path", "vertical_speed_mode"}
)
"""Effects that change the rate at given speeds, temperature and wind."""

EFFECTS_OF_NODE: dict[str, frozenset[str]] = {
    "IAS": frozenset({"speed_schedule"}),
    "Mach": frozenset({"airspeed_bias"}),
    "TAS": frozenset({"temperature"}),
    "height": frozenset({"temperature"}),
    "wind": frozenset({"wind_gradient"}),
    "rate": SPEEDS_KEPT,
    "reported": frozenset({"vertical_rate_lag"}),
    "stops": frozenset({"level_off"}),
}
"""Node of the causal graph -> effects that change its mechanism, given its parents, and no other node's."""

PARENTS_OF_NODE: dict[str, tuple[str, ...]] = {
    "IAS": (),
    "Mach": ("IAS",),
    "TAS": ("Mach",),
    "wind": (),
    "rate": ("IAS", "TAS", "wind"),
    "reported": ("rate",),
    "height": (),
    "stops": (),
}
"""Graph of a descent: the crew choose the speed; pressure altitude and IAS give Mach; Mach and temperature give TAS;
energy gives the rate at these speeds in this wind; the transponder reports it. The rest has no cause among them."""

TARGETS = ("reported", "height", "stops")
"""Nodes whose change is attributed: together they have every node among their ancestors."""


def graph(nodes: set[str]) -> list[tuple[str, str]]:
    """Edges (parent, child) among nodes that were measured; a missing parent is passed over to its own parents."""
    return [(parent, child) for child in PARENTS_OF_NODE if child in nodes for parent in _measured(child, nodes)]


def _measured(child: str, nodes: set[str]) -> list[str]:
    found: list[str] = []
    for parent in PARENTS_OF_NODE[child]:
        found += [parent] if parent in nodes else _measured(parent, nodes)
    return list(dict.fromkeys(found))
