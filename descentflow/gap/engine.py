"""The diagnosis itself: from flights and a simulator to a report."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import polars as pl

from descentflow.data.representation import Representation
from descentflow.errors import DataError
from descentflow.gap.effects import Effect
from descentflow.gap.report import GapReport
from descentflow.performance.aircraft import Aircraft
from descentflow.sampling.rejection import Sampler
from descentflow.surveillance.prepare import Cleaning

FEWEST_FLIGHTS = 20


@dataclass(frozen=True)
class Simulator:
    """What is diagnosed: a sampler with its representation, or nominal BADA where there is none."""

    aircraft: Aircraft
    sampler: Sampler | None = None
    representation: Representation | None = None
    content: Callable[[], dict[str, Any]] | None = None
    """Reads the checkpoint again, to write a corrected one."""
    name: str = "nominal"

    def cleaning(self) -> Cleaning:
        """How rows are prepared for it: down to its own lowest level."""
        if self.representation is None:
            return Cleaning()
        return Cleaning(bottom_fl=int(self.representation.decoder.levels_fl[0]))


def run(
    frame: pl.DataFrame,
    simulator: Simulator,
    channels: Sequence[str],
    catalogue: Mapping[str, Effect],
    seed: int,
    dropped: Mapping[str, int],
    say: Callable[[str], None],
) -> GapReport:
    """Diagnose."""
    raise DataError("the engine is being written", expected="its next commit", mend="wait for it")
