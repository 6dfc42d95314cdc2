"""Every equation's docstring names its section of the BADA 3 user manual (or of the paper, where it is the paper's)."""

import importlib
import inspect
import pkgutil
import re

import pytest

from descentflow import physics
from descentflow.aircraft_types.bada3.bada3_aircraft import Bada3Aircraft
from descentflow.aircraft_types.bada3.coefficients import Coefficients
from descentflow.physics import airspeed, atmosphere, energy, idle_state, level_table, nominal_descent

EQUATIONS = (airspeed, atmosphere, energy, idle_state, level_table, nominal_descent)
"""Modules in which every public function computes something of the manual."""
OTHERS = {"performance_model", "fuel"}
"""The protocol, and the law of fuel by thrust that both manuals' coefficients fill."""
NOT_EQUATIONS = {"slope_per_m", "is_below", "is_above"}
"""Differencing and comparison."""
SECTION = re.compile(r"\bmanual(?:'s)?(?:,? sections?)? [3-6]\.\d(?:\.\d|-\d+)?\b")

WRITTEN = {
    name: thing
    for module in EQUATIONS
    for name, thing in vars(module).items()
    if inspect.isfunction(thing) and thing.__module__ == module.__name__ and name not in NOT_EQUATIONS
} | {name: getattr(Bada3Aircraft, name) for name in sorted(set(dir(Bada3Aircraft)) - set(dir(Coefficients)))}
"""Equations of the manual, by name."""


def test_a_new_module_is_put_among_the_equations_or_among_the_others() -> None:
    modules = {module.name for module in pkgutil.iter_modules(physics.__path__)}
    assert modules == {module.__name__.rsplit(".", 1)[1] for module in EQUATIONS} | OTHERS


@pytest.mark.parametrize("name", [name for name in WRITTEN if not name.startswith("_")])
def test_an_equation_names_its_section_of_the_manual(name: str) -> None:
    text = " ".join((WRITTEN[name].__doc__ or "").split())
    assert SECTION.search(text), text


@pytest.mark.parametrize(
    ("module", "section"),
    [
        ("core.constants", "3.1"),
        ("aircraft_types.standard_descent", "5"),
        ("aircraft_types.bada3.coefficients", "3"),
        ("aircraft_types.bada3.opf_file", "6.4"),
        ("aircraft_types.bada3.apf_file", "6.5"),
        ("aircraft_types.bada3._bada_directory", "6.3 and 6.8"),
    ],
)
def test_a_file_s_reader_names_the_section_that_lays_it_down(module: str, section: str) -> None:
    reader = importlib.import_module(f"descentflow.{module}")
    text = reader.__doc__ or ""
    assert re.search(rf"manual[,(]? \(?sections? {re.escape(section)}\b", " ".join(text.split())), text
