"""Effects of the catalogue and of a user's file: names, words, and what is said where one cannot be used."""

import ast
from pathlib import Path

import pytest
import torch
from refusals import refuses

import descentflow
from descentflow.core.errors import ConfigError
from descentflow.core.user_files import lines_named
from descentflow.effects import EFFECTS, Effect, Parameter, checked_catalogue
from descentflow.effects._example_flights import example_flights
from descentflow.effects.user_catalogue import effects_of_file

GUSTS = '''
from dataclasses import dataclass
from descentflow.effects import EFFECTS, Effect, Parameter
from descentflow.effects.temperature import Temperature

class Noise(Effect):
    """A base of others: it has no shift."""

class Gusts(Noise):
    name = "gusts"
    parameters = (Parameter("ratio", -2.0, 2.0, "1", 0.2),)
    def shift(self, state, theta):
        return {"level": theta[0].expand(len(state.cas_mps))}

@dataclass(frozen=True)
class Scaled(Noise):
    by: float
    parameters = Gusts.parameters
    name = "scaled"
    def shift(self, state, theta):
        return {"slow": self.by * theta[0].expand(len(state.cas_mps))}

scaled = Scaled(3.0)
again = scaled
'''


def file(folder: Path, text: str) -> Path:
    path = folder / "own.py"
    path.write_text(text)
    return path


def test_classes_and_instances_are_taken_and_what_is_imported_is_not(tmp_path: Path) -> None:
    effects = effects_of_file(file(tmp_path, GUSTS), frozenset(EFFECTS))
    assert sorted(effects) == ["gusts", "scaled"]
    shift = effects["scaled"].shift(example_flights(2), torch.tensor([0.5]))
    assert shift["slow"].tolist() == [1.5, 1.5]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("from descentflow.effects import EFFECTS, Effect\n", "own.py: no effect"),
        ("x = 1\ny = x / 0\n", "own.py, line 2: ZeroDivisionError: division by zero"),
        ("def f():\n    raise ValueError('no')\n\nf()\n", "own.py, line 2: ValueError: no"),
        ("x = (\n", "own.py, line 1: SyntaxError: .*never closed"),
        (GUSTS.replace('"gusts"', '"mass"'), "effect 'mass', a name that is taken"),
        (GUSTS.replace('"gusts"', '"scaled"'), "two effects of the name 'scaled'"),
        (GUSTS.replace("scaled = Scaled(3.0)\nagain = scaled", ""), "TypeError: .*missing 1 required"),
        (GUSTS.replace('    name = "gusts"\n', ""), "class Gusts without `name` and `parameters`"),
    ],
)
def test_what_cannot_be_used_is_said_with_its_line(tmp_path: Path, text: str, message: str) -> None:
    refuses(ConfigError, message, effects_of_file, file(tmp_path, text), frozenset(EFFECTS))


def test_files_that_are_not_there_or_no_python_are_refused(tmp_path: Path) -> None:
    refuses(ConfigError, "no such file", effects_of_file, tmp_path / "none.py")
    (tmp_path / "own.txt").write_text(GUSTS)
    refuses(ConfigError, "no Python file", effects_of_file, tmp_path / "own.txt")


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ("{'noise': 0}", r"own.py, line 12: shift of effect 'gusts' gives the quantity 'noise'; expected some of rate"),
        (
            "{'rate': theta[0]}",
            r"own.py, line 12: shift of effect 'gusts' gives \(\) for rate; expected a tensor \(6, 11\)",
        ),
        ("{'level': 0.1}", r"line 12: .* gives float for level; expected a tensor \(6,\): flights;"),
        ("{'rate': float('nan') * state.cas_mps}", r"line 12: .* gives NaN or infinity for rate; expected numbers"),
        ("{'noise_rate': theta[0].expand(6)}", r"line 12: .* gives noise alone; expected a change of what is flown"),
        ("theta", r"line 12: .* gives a Tensor; expected a dictionary"),
        ("state.no_such_thing", r"own.py, line 13: AttributeError: .*no_such_thing"),
    ],
)
def test_a_shift_that_cannot_be_used_is_refused_with_its_line(tmp_path: Path, wrong: str, message: str) -> None:
    right = '{"level": theta[0].expand(len(state.cas_mps))}'
    path = file(tmp_path, GUSTS.replace(right, wrong))
    with pytest.raises(ConfigError, match=message), lines_named(path):
        checked_catalogue(effects_of_file(path))


def test_an_error_of_the_package_keeps_its_own_lines(tmp_path: Path) -> None:
    with pytest.raises(ZeroDivisionError), lines_named(file(tmp_path, GUSTS)):
        1 / 0  # noqa: B018


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
        refuses(ConfigError, message, checked_catalogue, catalogue)
    assert checked_catalogue(EFFECTS) is EFFECTS
