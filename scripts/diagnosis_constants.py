"""What moves in a diagnosis when one of its constants is halved or doubled: prints the table of the documentation.

Sets of known truth are simulated and prepared once; each constant is then changed by itself, flights are measured and
the causes selected anew. ``--flights`` and ``--seed`` choose other sets.
"""

import argparse
import importlib
import pkgutil
import sys
import tempfile
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from unittest.mock import patch

import torch

from descentflow.aircraft_types.open_types.open_aircraft import open_aircraft
from descentflow.core.errors import DescentflowWarning
from descentflow.diagnosis.diagnosis_settings import Settings
from descentflow.diagnosis.inference.shared_effects import shared_effects
from descentflow.diagnosis.inference.spread_learnt import select_by_either
from descentflow.diagnosis.inference.two_sides import compare
from descentflow.diagnosis.inference.where import where
from descentflow.diagnosis.open_both import open_both
from descentflow.diagnosis.procedure import Diagnosis
from descentflow.diagnosis.reference_flights import both_sides
from descentflow.diagnosis.simulator_flights import SignatureSource
from descentflow.effects import EFFECTS
from descentflow.measurements.quantities import quantities_of
from descentflow.measurements.quantity_registry import CHANNELS
from descentflow.simulation.world import simulate
from descentflow.surveillance.descents.prepared_descents import read_descents, write_descents
from descentflow.surveillance.prepare import prepare

SETS: dict[str, dict[str, dict[str, float]]] = {
    "none": {},
    "drag": {"drag_polar": {"factor": 1.06}},
    "warm": {"temperature": {"deviation_k": 6.0}},
    "brakes": {"speed_brake": {"factor": 1.5, "share": 0.5, "low_fl": 220.0, "high_fl": 270.0}},
    "warm and drag": {"temperature": {"deviation_k": 6.0}, "drag_polar": {"factor": 1.1}},
    "held rates": {"vertical_speed_mode": {"share": 0.6, "of_idle": 0.85}},
    "paths": {"geometric_path": {"share": 0.6, "of_idle": 0.9}},
    "late": {"vertical_rate_lag": {"lag_s": 8.0}},
    "turns": {"turn": {}},
    "noisy": {"measurement_noise": {"factor": 2.0}},
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

    @property
    def short(self) -> str:
        """As the documentation names it."""
        return f"`{self.module.rpartition('.')[2]}.{self.name}`"

    @contextmanager
    def at(self, value: Any) -> Iterator[None]:
        """The diagnosis with another value, in every module that imported this one by its name."""
        before = self.value
        loaded = [module for name, module in list(sys.modules.items()) if name.startswith("descentflow.")]
        with ExitStack() as changed:
            for home in (self._home, *loaded):
                if vars(home).get(self.name) is before:
                    changed.enter_context(patch.object(home, self.name, value))
            yield

    @property
    def _home(self) -> Any:
        """The module, or the class in it."""
        return pkgutil.resolve_name(f"descentflow.{self.module}")


INFERENCE = "diagnosis.inference"


def constants() -> list[Constant]:
    """Those that decide what is named; of a probability the odds against it are halved and doubled."""
    return [
        Constant(f"{INFERENCE}.inclusion", "NAMED", 0.905, 0.974),
        Constant(f"{INFERENCE}.selection", "OUTSIDE", 1 / 3, 2 / 3),
        Constant("diagnosis.findings.findings", "SIGNIFICANT", 0.01, 0.04),
        Constant(f"{INFERENCE}.set_search", "LOG_PRIOR_ODDS", -1.25, -5.0),
        Constant(f"{INFERENCE}.set_search", "SCREENED_GAP", 4.0, 16.0),
        Constant(f"{INFERENCE}.set_search", "FIRST", 2, 8),
        Constant(f"{INFERENCE}.set_search", "MOST_GROWN", 3, 10),
        Constant(f"{INFERENCE}.set_search", "WITH_DISCREPANCY", 3, 12),
        Constant(f"{INFERENCE}.subset_screening", "MAX_EFFECTS", 2, 5),
        Constant(f"{INFERENCE}.mean_air", "FALSELY_WIDER", 0.0005, 0.002),
        Constant(f"{INFERENCE}.mean_air", "MOST_ERROR", 2.0, 8.0),
        Constant(f"{INFERENCE}.model_weights", "ODD", 0.005, 0.02),
        Constant(f"{INFERENCE}.normal_flights", "FALSELY_NARROW", 0.0005, 0.002),
        Constant(f"{INFERENCE}.signature_columns", "MISFIT", 0.015, 0.06),
        Constant("effects.effect.Effect", "misfit_of_rate", 0.25, 1.0),
        Constant("effects.drag_polar.DragPolar", "misfit_of_rate", 0.05, 0.2),
        Constant("effects.wind_gradient.WindGradient", "misfit_of_rate", 0.05, 0.2),
        Constant("effects.speed_brake.SpeedBrake", "misfit_of_rate", 0.05, 0.2),
        Constant(f"{INFERENCE}.signature_columns", "KNOTS", 2, 6),
        Constant(f"{INFERENCE}.discrepancy", "SPREAD", 5.0, 20.0),
        Constant(f"{INFERENCE}.credible", "MIN_MEAN_SHIFT", 0.75, 3.0),
        Constant(f"{INFERENCE}.credible", "LEAST_ITS_OWN", 1 / 3, 2 / 3),
        Constant(f"{INFERENCE}.heterogeneity", "MIN_VARIANCE_SHARE", 0.125, 0.5),
        Constant(f"{INFERENCE}.left_over", "THIRDS", 2, 6),
        *_of_flight_laws(),
        *_of_measurement(),
        *_of_effects(),
    ]


def _of_flight_laws() -> list[Constant]:
    return [
        Constant(f"{INFERENCE}.mixed_fit", "MAX_ROUNDS", 2, 8),
        Constant(f"{INFERENCE}.flight_fit", "MAX_SECANTS", 2, 8),
        Constant(f"{INFERENCE}.flight_fit", "MAX_STEPS", 7, 30),
        Constant(f"{INFERENCE}.flight_fit", "FINE_STEPS", 1, 6),
        Constant(f"{INFERENCE}.flight_fit", "MIN_EM_GAIN", 0.1, 0.4),
        Constant(f"{INFERENCE}.flight_laws", "NEGLIGIBLE", 12.5, 50.0),
        Constant("effects.speed_brake.SpeedBrake", "grid_fl", 2.5, 10.0),
        Constant("effects.speed_brake", "COARSE_FL", 5.0, 20.0),
    ]


def _of_measurement() -> list[Constant]:
    negligible = importlib.import_module(f"descentflow.{INFERENCE}.two_sides").NEGLIGIBLE
    coefficients = importlib.import_module(f"descentflow.{INFERENCE}.reference_coefficients")
    spreads = coefficients.PRIOR_SPREAD
    return [
        Constant(
            f"{INFERENCE}.two_sides", "NEGLIGIBLE", *({k: f * v for k, v in negligible.items()} for f in (0.5, 2))
        ),
        Constant(f"{INFERENCE}.two_sides", "FEWEST_APART", 4, 14),
        Constant(f"{INFERENCE}.two_sides", "MIN_SHARE", 0.05, 0.2),
        Constant(f"{INFERENCE}.two_sides", "EXTREME", 3.0, 12.0),
        Constant(
            f"{INFERENCE}.reference_coefficients", "PRIOR_SPREAD", *(tuple(f * v for v in spreads) for f in (0.5, 2))
        ),
        Constant(f"{INFERENCE}.reference_coefficients", "EQUATION_SPREAD", 0.05, 0.2),
        Constant(f"{INFERENCE}.where", "FALSE_CELLS", 0.025, 0.1),
        Constant(f"{INFERENCE}.where", "MATTERS", 0.25, 1.0),
        Constant("measurements.turning", "STEPS", 4, 12),
        Constant("measurements.turning", "MOST_BANK_DEG", 17.5, 70.0),
        Constant("measurements.level_channels", "QUIET", 0.4, 1.0),
        Constant("measurements.level_channels", "LEAST_NOISE", 0.25, 1.0),
    ]


def _of_effects() -> list[Constant]:
    return [
        Constant("effects.speed_brake", "LEAST_DRAG", 0.05, 0.2),
        Constant("effects.speed_brake", "NARROWEST_FL", 12.5, 50.0),
        Constant("effects.speed_brake", "FROM_TOP_FL", 2.5, 10.0),
        Constant("effects.vertical_rate_lag", "LEAST_LAG_S", 1.5, 6.0),
        Constant("effects.vertical_speed_mode", "LEAST_CUT_OUT", 0.025, 0.1),
        Constant("effects.vertical_speed_mode", "SLOWER", (0.1, 0.05), (0.4, 0.2)),
        Constant("effects.geometric_path", "LEAST_SHALLOWER", 0.0025, 0.01),
        Constant("effects.turn", "AS_MEASURED", (0.75, 1.25), (0.0, 2.0)),
        Constant("effects.turn", "LEAST_DRAG", 0.0025, 0.01),
    ]


def of_shared_effects() -> list[Constant]:
    """Those that decide which effects show against physics alone."""
    home = f"{INFERENCE}.shared_effects"
    return [
        Constant(home, "MIN_GAIN", 10.0, 40.0),
        Constant(home, "MIN_GAIN_Z", 2.0, 8.0),
        Constant(home, "MIN_FURTHER_SHARE", 0.025, 0.1),
        Constant(home, "MAX_EFFECTS", 2, 6),
    ]


def ready_to_diagnose(folder: Path, name: str, flights: int, seed: int) -> Callable[[], Diagnosis]:
    """A set that is prepared; what measures and diagnoses it does so with the constants of its time."""
    simulator = descents(folder, "simulator", {}, flights, seed)
    opened = open_both(descents(folder, name, SETS[name], flights, seed + 1), simulator, SignatureSource("A320"))
    asked = Settings(opened.simulator, EFFECTS, CHANNELS, 0, lambda _: None)

    def begin() -> Diagnosis:
        sides = both_sides(asked.simulator, opened.frame, asked.channels, 0)
        return Diagnosis(compare(sides.reference, sides.real, asked.simulator.aircraft), asked, sides.source)

    return begin


def ready_for_physics(folder: Path, name: str, flights: int, seed: int) -> Callable[[], str]:
    """The same set held against physics alone, as where a simulator's own flights have what the real ones have."""
    descents_of = read_descents(descents(folder, name, SETS[name], flights, seed + 1)).frame
    real, a320 = quantities_of(descents_of, 150, 340, CHANNELS), open_aircraft("A320")

    def answer() -> str:
        found = shared_effects(real, a320, EFFECTS, 0, lambda _: None)
        gains = {} if found is None else found.chosen.gains
        return ", ".join(f"{effect} ({gain:.0f} nats)" for effect, (gain, _) in gains.items()) or "nothing"

    return answer


def descents(folder: Path, name: str, plant: dict[str, dict[str, float]], flights: int, seed: int) -> Path:
    """Prepared descents with effects planted, made once."""
    path = folder / f"{name}.parquet"
    if not path.exists():
        rows = folder / f"{name}-rows.parquet"
        simulate(open_aircraft("A320"), flights, seed, plant=plant).rows.write_parquet(rows)
        write_descents(prepare(rows), path)
    return path


def says(diagnosis: Diagnosis) -> str:
    """The causes with their groups and probabilities, and the verdict where there is a gap."""
    seed = diagnosis.settings.seed
    diagnosis.learnt, chosen = select_by_either(diagnosis.learnt, diagnosis.discrepancy, seed, lambda _: None)
    cells, _ = where(diagnosis.likelihood, diagnosis.settings.transition_fl, seed)
    parts = [f"{'/'.join((n, *chosen.groups[n]))} {chosen.probability[n]:.2f}" for n in chosen.fit.effects]
    return f"{', '.join(parts) or 'nothing'} ({diagnosis.verdict(0.0, chosen, cells)})"


def _short(value: Any) -> str:
    """A value as a cell of a table; of many values the first."""
    return f"{next(iter(value.values()))}, ..." if isinstance(value, dict) else f"{value}"


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--flights", type=int, default=150, help="of either side (default: %(default)s)")
    parser.add_argument("--seed", type=int, default=1, help="of the simulated flights (default: %(default)s)")
    parser.add_argument("--sets", nargs="+", default=list(SETS), help="default: all")
    names = list(dict.fromkeys(constant.name for constant in (*constants(), *of_shared_effects())))
    parser.add_argument("--constants", nargs="+", default=names, choices=names, metavar="NAME", help="default: all")
    args = parser.parse_args()
    torch.set_num_threads(1)
    warnings.simplefilter("ignore", DescentflowWarning)
    with tempfile.TemporaryDirectory() as name:
        made = Path(name), args.flights, args.seed
        begun = {one: ready_to_diagnose(made[0], one, *made[1:]) for one in args.sets}
        print_moves(constants(), args.constants, {one: lambda one=one: says(begun[one]()) for one in begun})
        alone = {f"{one}, physics alone": ready_for_physics(made[0], one, *made[1:]) for one in args.sets}
        print_moves(of_shared_effects(), args.constants, alone)


def print_moves(rows: Sequence[Constant], wanted: Sequence[str], sets: Mapping[str, Callable[[], str]]) -> None:
    """A line of the table for each value of each constant, with the sets whose answer it moves."""
    rows = [one for one in rows if one.name in wanted]
    usual = {one: answer() for one, answer in sets.items()} if rows else {}
    for one, said in usual.items():
        print(f"as it is, {one}: {said}", flush=True)
    for constant in rows:
        for value in (constant.less, constant.more):
            with constant.at(value):
                now = {one: answer() for one, answer in sets.items()}
            told = "; ".join(f"{one}: {said}" for one, said in now.items() if said != usual[one]) or "nothing"
            print(f"| {constant.short} | {_short(constant.value)} | {_short(value)} | {told} |", flush=True)


if __name__ == "__main__":
    main()
