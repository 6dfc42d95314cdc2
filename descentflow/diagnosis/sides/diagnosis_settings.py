"""Settings of a diagnosis."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

from descentflow.core.units import FL_M
from descentflow.diagnosis.findings.findings import Findings
from descentflow.diagnosis.sides.simulator import Simulator
from descentflow.effects import Effect


@dataclass(frozen=True)
class Settings:
    """Settings of a diagnosis.

    Attributes:
        simulator: What is diagnosed.
        catalogue: Effects that may be named.
        channels: Channels to use.
        seed: Of permutations, folds, bootstrap and samples.
        progress: Called with what is being done.
        previous: The round before, where this one is compared with one.
        previous_name: Of its file.

    Example:
        >>> from descentflow.aircraft_types.registry import aircraft
        >>> from descentflow.effects import EFFECTS
        >>> round(Settings(Simulator(aircraft("A320")), EFFECTS, ["IAS", "vertical_rate"], 0, print).transition_fl)
        318
    """

    simulator: Simulator
    catalogue: Mapping[str, Effect]
    channels: Sequence[str]
    seed: int
    progress: Callable[[str], None]
    previous: Findings | None = None
    previous_name: str = ""

    @property
    def transition_fl(self) -> float:
        """Flight level at which nominal BADA hands over from Mach to CAS."""
        return float(self.simulator.aircraft.transition_altitude_m()) / FL_M
