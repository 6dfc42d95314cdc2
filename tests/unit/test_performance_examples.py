"""The examples in the docstrings are run, save those that need a licence holder's files."""

import doctest
import importlib

import pytest
import torch

MODULES = (
    "airspeed",
    "atmosphere",
    "configuration",
    "energy",
    "envelope",
    "fixed_columns",
    "forces",
    "fuel",
    "global_parameters",
    "nominal",
    "registry",
    "schedule",
    "tensors",
    "thresholds",
    "transition",
)


@pytest.mark.parametrize("name", MODULES)
def test_examples_give_what_they_say(name):
    module = importlib.import_module(f"descentflow.performance.{name}")
    result = doctest.testmod(module, extraglobs={"torch": torch})
    assert result.attempted > 0
    assert result.failed == 0
