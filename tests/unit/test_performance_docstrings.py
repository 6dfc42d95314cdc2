"""Every equation's docstring names its section of the BADA 3 user manual (or of the paper, where it is the paper's)."""

import importlib
import inspect
import pkgutil
import re

import pytest

import descentflow.performance
from descentflow.performance import (
    airspeed,
    atmosphere,
    configuration,
    energy,
    envelope,
    forces,
    fuel,
    level_table,
    nominal,
    schedule,
    state,
    transition,
)

EQUATIONS = (
    airspeed,
    atmosphere,
    configuration,
    energy,
    envelope,
    forces,
    fuel,
    level_table,
    nominal,
    schedule,
    state,
    transition,
)
"""Modules in which every public function computes something of the manual."""
OTHERS = {
    "aircraft",
    "apf_file",
    "bada_files",
    "constants",
    "fixed_columns",
    "global_parameters",
    "gpf_file",
    "open_aircraft",
    "opf_file",
    "registry",
    "synonym_file",
    "tensors",
    "thresholds",
}
"""Data, files and tools. What stands for a section of the manual as a whole says so in the module's docstring."""
NOT_EQUATIONS = {"by_configuration", "slope_per_m"}
"""Selection and differencing."""
SECTION = re.compile(r"\bmanual(?:'s)?(?:,? sections?)? [3-6]\.\d(?:\.\d|-\d+)?\b")

FUNCTIONS = [
    (module.__name__.rsplit(".", 1)[1], name)
    for module in EQUATIONS
    for name, thing in vars(module).items()
    if inspect.isfunction(thing) and thing.__module__ == module.__name__ and not name.startswith("_")
]


def test_a_new_module_is_put_among_the_equations_or_among_the_others() -> None:
    found = {module.name for module in pkgutil.iter_modules(descentflow.performance.__path__)}
    assert found == {module.__name__.rsplit(".", 1)[1] for module in EQUATIONS} | OTHERS


@pytest.mark.parametrize(("module", "name"), [pair for pair in FUNCTIONS if pair[1] not in NOT_EQUATIONS])
def test_an_equation_names_its_section_of_the_manual(module: str, name: str) -> None:
    text = " ".join((getattr(importlib.import_module(f"descentflow.performance.{module}"), name).__doc__ or "").split())
    assert SECTION.search(text), text


@pytest.mark.parametrize(
    ("module", "section"),
    [
        ("constants", "3.1"),
        ("global_parameters", "5"),
        ("aircraft", "3"),
        ("synonym_file", "6.3"),
        ("opf_file", "6.4"),
        ("apf_file", "6.5"),
        ("gpf_file", "6.8"),
    ],
)
def test_a_file_s_reader_names_the_section_that_lays_it_down(module: str, section: str) -> None:
    found = importlib.import_module(f"descentflow.performance.{module}")
    text = (found.__doc__ or "") + (found.Aircraft.__doc__ or "" if module == "aircraft" else "")
    assert re.search(rf"manual[,(]? \(?sections? {re.escape(section)}\b", " ".join(text.split())), text
