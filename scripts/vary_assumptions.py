"""Halve and double each assumption of the diagnosis, on flights of your own, and print what moves.

python scripts/vary_assumptions.py REAL SIMULATOR [--typecode A320]
"""

import argparse
from collections.abc import Iterator, Mapping
from dataclasses import fields, replace
from typing import Any

import torch

from descentflow.core.threads import one_thread
from descentflow.diagnosis.inference.explain import explain
from descentflow.diagnosis.inference.verdict import verdict_of
from descentflow.diagnosis.sides.assumptions import ASSUMED, Assumptions
from descentflow.diagnosis.sides.diagnosis_inputs import Inputs
from descentflow.diagnosis.sides.measured_sides import both_sides
from descentflow.diagnosis.sides.two_sides import compare
from descentflow.effects import EFFECTS
from descentflow.measurements.quantity_registry import CHANNELS

PROBABILITIES = ("inclusion", "named", "least_share", "least_shown", "false_gap", "false_cells")
"""Assumptions whose odds are halved and doubled: half of 95 % would be no probability that anyone asks for."""


def varied(value: Any, factor: float, *, odds: bool = False) -> Any:
    """An assumption times a factor, each of its numbers; or with so many times the odds.

    Example:
        >>> varied((2.0, 6.0), 0.5), round(varied(0.95, 2.0, odds=True), 3)
        ((1.0, 3.0), 0.974)
    """
    if isinstance(value, Mapping):
        return {name: factor * number for name, number in value.items()}
    if isinstance(value, tuple):
        return tuple(factor * number for number in value)
    return factor * value / (1.0 + (factor - 1.0) * value) if odds else factor * value


def every() -> Iterator[tuple[str, Assumptions]]:
    """The usual assumptions, and each of them halved and doubled."""
    yield "as they are", ASSUMED
    for field in fields(Assumptions):
        for factor in (0.5, 2.0):
            value = varied(getattr(ASSUMED, field.name), factor, odds=field.name in PROBABILITIES)
            yield f"{field.name} x {factor:g}", replace(ASSUMED, **{field.name: value})


def main() -> None:
    """Print verdict, causes and sizes under each."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("real")
    parser.add_argument("simulator")
    parser.add_argument("--typecode", help="whose coefficients give the signatures (default: the flights' own)")
    asked = parser.parse_args()
    opened = Inputs(asked.real, asked.simulator, asked.typecode).open()
    sides, usual = both_sides(opened.simulator, opened.frame, CHANNELS), ""
    for name, assumed in every():
        with one_thread(), torch.inference_mode():
            explained = explain(compare(sides.simulated, sides.real, opened.simulator.aircraft, assumed), EFFECTS)
        sizes = [f"{effect} {float(theta[0]):.3g}" for effect, theta in explained.theta.items()]
        answer = ", ".join([verdict_of(explained), *sizes])
        usual = usual or answer
        print(f"{name:<28}{'-' if answer == usual and name != 'as they are' else answer}", flush=True)


if __name__ == "__main__":
    main()
