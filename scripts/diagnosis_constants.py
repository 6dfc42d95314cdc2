"""What moves in a diagnosis when one of its constants is halved or doubled: prints the table of the documentation.

Sets of known truth are simulated and prepared once; each constant is then changed by itself and the causes are selected
anew. ``--flights`` and ``--seed`` choose other sets.
"""

import argparse
import importlib
import tempfile
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import torch

from descentflow.aircraft_types.open_types.open_aircraft import open_aircraft
from descentflow.core.errors import DescentflowWarning
from descentflow.diagnosis.diagnosis_settings import Settings
from descentflow.diagnosis.inference.selection import Chosen, select
from descentflow.diagnosis.inference.two_sides import compare
from descentflow.diagnosis.open_both import open_both
from descentflow.diagnosis.procedure import Diagnosis
from descentflow.diagnosis.reference_flights import both_sides
from descentflow.diagnosis.simulator_flights import SignatureSource
from descentflow.effects import EFFECTS
from descentflow.measurements.quantity_registry import CHANNELS
from descentflow.simulation.world import simulate
from descentflow.surveillance.descents.prepared_descents import write_descents
from descentflow.surveillance.prepare import prepare

SETS: dict[str, dict[str, dict[str, float]]] = {
    "none": {},
    "drag": {"drag_polar": {"factor": 1.06}},
    "warm": {"temperature": {"deviation_k": 6.0}},
    "brakes": {"speed_brake": {"factor": 1.5, "share": 0.5, "low_fl": 220.0, "high_fl": 270.0}},
    "warm and drag": {"temperature": {"deviation_k": 6.0}, "drag_polar": {"factor": 1.1}},
    "brakes in own air": {
        "speed_brake": {"factor": 1.5, "share": 0.5, "spread_fl": 15.0},
        "temperature": {"deviation_k": 6.0, "spread_k": 3.0},
    },
}
"""What is planted in the flights that stand for the real ones, by set."""


@dataclass(frozen=True)
class Constant:
    """A number of the diagnosis, and two others in its place."""

    module: str
    name: str
    less: Any
    more: Any

    @property
    def value(self) -> Any:
        """As it is."""
        return getattr(self._home, self.name)

    @contextmanager
    def at(self, value: Any) -> Iterator[None]:
        """The diagnosis with another value."""
        before = self.value
        setattr(self._home, self.name, value)
        try:
            yield
        finally:
            setattr(self._home, self.name, before)

    @property
    def _home(self) -> Any:
        return importlib.import_module(f"descentflow.diagnosis.{self.module}")


def constants() -> list[Constant]:
    """Those that decide what is named; of a probability the odds against it are halved and doubled."""
    return [
        Constant("inference.inclusion", "NAMED", 0.905, 0.974),
        Constant("inference.selection", "OUTSIDE", 1 / 3, 2 / 3),
        Constant("procedure", "SIGNIFICANT", 0.01, 0.04),
        Constant("inference.set_search", "LOG_PRIOR_ODDS", -1.25, -5.0),
        Constant("inference.set_search", "SCREENED_GAP", 4.0, 16.0),
        Constant("inference.set_search", "FIRST", 2, 8),
        Constant("inference.set_search", "WITH_DISCREPANCY", 3, 12),
        Constant("inference.mean_air", "FALSELY_WIDER", 0.0005, 0.002),
        Constant("inference.mean_air", "MOST_ERROR", 2.0, 8.0),
        Constant("inference.model_weights", "ODD", 0.005, 0.02),
        Constant("inference.signature_columns", "MISFIT", 0.015, 0.06),
        Constant("inference.signature_columns", "MISFIT_OF_RATE", 0.25, 1.0),
        Constant("inference.signature_columns", "KNOTS", 2, 6),
        Constant("inference.discrepancy", "SPREAD", 5.0, 20.0),
        Constant("inference.credible", "MIN_MEAN_SHIFT", 0.75, 3.0),
        Constant("inference.credible", "LEAST_ITS_OWN", 1 / 3, 2 / 3),
        Constant("inference.heterogeneity", "MIN_VARIANCE_SHARE", 0.125, 0.5),
        Constant("inference.left_over", "THIRDS", 2, 6),
    ]


def ready_to_diagnose(folder: Path, name: str, flights: int, seed: int) -> Callable[[], Diagnosis]:
    """A set that is measured; a diagnosis of it begins with the constants of its time."""
    simulator = descents(folder, "simulator", {}, flights, seed)
    opened = open_both(descents(folder, name, SETS[name], flights, seed + 1), simulator, SignatureSource("A320"))
    asked = Settings(opened.simulator, EFFECTS, CHANNELS, 0, lambda _: None)
    sides = both_sides(asked.simulator, opened.frame, asked.channels, 0)
    compared = compare(sides.reference, sides.real, asked.simulator.aircraft)
    return lambda: Diagnosis(compared, asked, sides.source)


def descents(folder: Path, name: str, plant: dict[str, dict[str, float]], flights: int, seed: int) -> Path:
    """Prepared descents with effects planted, made once."""
    path = folder / f"{name}.parquet"
    if not path.exists():
        rows = folder / f"{name}-rows.parquet"
        simulate(open_aircraft("A320"), flights, seed, plant=plant).rows.write_parquet(rows)
        write_descents(prepare(rows), path)
    return path


def says(diagnosis: Diagnosis, chosen: Chosen) -> str:
    """The causes with their groups and probabilities, and the verdict where there is a gap."""
    parts = [f"{'/'.join((n, *chosen.groups[n]))} {chosen.probability[n]:.2f}" for n in chosen.fit.effects]
    return f"{', '.join(parts) or 'nothing'} ({diagnosis.verdict(0.0, chosen)})"


def _answer(diagnosis: Diagnosis) -> str:
    return says(diagnosis, select(diagnosis.searched, diagnosis.discrepancy, lambda _: None))


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--flights", type=int, default=150, help="of either side (default: %(default)s)")
    parser.add_argument("--seed", type=int, default=1, help="of the simulated flights (default: %(default)s)")
    parser.add_argument("--sets", nargs="+", default=list(SETS), help="default: all")
    names = [constant.name for constant in constants()]
    parser.add_argument("--constants", nargs="+", default=names, choices=names, metavar="NAME", help="default: all")
    args = parser.parse_args()
    torch.set_num_threads(1)
    warnings.simplefilter("ignore", DescentflowWarning)
    with tempfile.TemporaryDirectory() as name:
        ready = {one: ready_to_diagnose(Path(name), one, args.flights, args.seed) for one in args.sets}

        def answers() -> dict[str, str]:
            return {one: _answer(begin()) for one, begin in ready.items()}

        usual = answers()
        for one, answer in usual.items():
            print(f"as it is, {one}: {answer}", flush=True)
        for constant in (one for one in constants() if one.name in args.constants):
            for value in (constant.less, constant.more):
                with constant.at(value):
                    moved = {one: answer for one, answer in answers().items() if answer != usual[one]}
                told = "; ".join(f"{one}: {answer}" for one, answer in moved.items()) or "nothing"
                print(f"| {constant.module}.{constant.name} | {constant.value} | {value} | {told} |", flush=True)


if __name__ == "__main__":
    main()
