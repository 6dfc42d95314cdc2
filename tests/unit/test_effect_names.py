"""Nothing outside the effects, the world that injects them and the studies' plans names an effect."""

import ast
from pathlib import Path

import pytest

import descentflow
from descentflow.core.errors import ConfigError
from descentflow.effects import EFFECTS, Effect, Parameter, checked_catalogue

PACKAGE = Path(descentflow.__file__).parent
MAY_NAME = ("effects", "simulation")
ALSO = {"surveillance": {"temperature"}, "aircraft_types": {"idle_thrust"}, "repairs": {"mass"}}
"""Package -> names that are also names of a column of rows, a coefficient or a part of a variance."""


def strings(path: Path) -> list[str]:
    """Every string constant of a file."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    return [node.value for node in ast.walk(tree) if isinstance(node, ast.Constant) and isinstance(node.value, str)]


def test_nothing_else_names_an_effect() -> None:
    strays = []
    for path in sorted(PACKAGE.rglob("*.py")):
        place = path.relative_to(PACKAGE)
        names = set(EFFECTS) - ALSO.get(place.parts[0], set())
        if place.parts[0] not in MAY_NAME:
            strays += [f"{place}: {text}" for text in strings(path) if text in names]
    assert strays == []


@pytest.mark.parametrize("name", EFFECTS)
def test_every_effect_has_words_and_labels(name: str) -> None:
    effect = EFFECTS[name]
    assert effect.description
    assert effect.in_words(None) == effect.description
    assert all(parameter.label for parameter in effect.parameters)
    if effect.directions is not None:
        assert (effect.in_words(1.0), effect.in_words(-1.0)) == effect.directions


class Nameless(Effect):
    """Without any words."""

    name = "odd_thing"
    parameters = (Parameter("some_size", -1.0, 1.0, "1", 0.1),)

    def shift(self, state, theta):  # type: ignore[no-untyped-def]
        return {"rate": theta[0]}


def test_a_catalogue_that_cannot_be_used_gets_a_clear_error() -> None:
    class Strange(Nameless):
        needs = ("speed",)

    class Sizeless(Nameless):
        parameters = ()

    for catalogue, message in (
        ({}, "empty catalogue"),
        ({"other": Nameless()}, "'odd_thing' under the name 'other'"),
        ({"odd_thing": Strange()}, "channel 'speed' of effect 'odd_thing'"),
        ({"odd_thing": Sizeless()}, "without a parameter"),
    ):
        with pytest.raises(ConfigError, match=message):
            checked_catalogue(catalogue)
    assert checked_catalogue(EFFECTS) is EFFECTS
