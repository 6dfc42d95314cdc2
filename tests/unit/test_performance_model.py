"""The seam of performance models: what is behind it is read nowhere else."""

import ast
from dataclasses import fields
from pathlib import Path

import descentflow
from descentflow.aircraft_types.bada3.coefficients import Coefficients
from descentflow.aircraft_types.registry import aircraft
from descentflow.physics.performance_model import PerformanceModel

PACKAGE = Path(descentflow.__file__).parent
BEHIND = {field.name for field in fields(Coefficients)} - set(dir(PerformanceModel)) - {"engine", "limits"}
"""Coefficients of BADA 3 that no other model has."""


def test_a_type_is_a_performance_model() -> None:
    assert isinstance(aircraft("A320"), PerformanceModel)
    assert not isinstance("A320", PerformanceModel)


def test_coefficients_of_bada_3_are_read_by_its_model_alone() -> None:
    strays = [
        f"{path.relative_to(PACKAGE)}:{node.lineno} {node.attr}"
        for path in sorted(PACKAGE.rglob("*.py"))
        if path.relative_to(PACKAGE).parts[0] != "aircraft_types"
        for node in ast.walk(ast.parse(path.read_text()))
        if isinstance(node, ast.Attribute) and node.attr in BEHIND
    ]
    assert strays == []
