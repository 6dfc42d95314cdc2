"""A first look at the words after ``fit``, ``validate``, ``test`` and ``predict``, before seconds of imports.

What is wrong in a name is said at once and in a line, and what is surely wrong in a value. Names and types are read
from the sources of the classes that take them, without importing these, so they cannot go stale. Other values, and
options of the Trainer (which Lightning owns), are left to the full parser.
"""

import ast
from collections.abc import Iterable, Sequence
from functools import cache
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from descentflow.cli.option_kinds import how_to_write, in_words, is_wrong
from descentflow.configs.packaged_config import config_file
from descentflow.core.errors import ConfigError, nearest
from descentflow.core.settings_file import read_settings
from descentflow.training.models import MODULES

TOP = (
    *("config", "model", "data", "trainer", "scores", "checkpoint", "optimizer", "lr_scheduler", "ckpt_path"),
    *("seed_everything", "weights_only", "print_config", "verbose", "final", "help", "help_all"),
)
MODELS = tuple(sorted(set(MODULES) - {"LatentModel"}))
IN_PYTHON = ("gaussian", "mixture", "flow", "spline")
"""Names of the models in :func:`descentflow.training.fit.fit`."""
OTHER_NAMES = {
    "gaussian": ("Gaussian", "gaussian"),
    **dict.fromkeys(("mixture", "gmm", "gaussianmixture"), ("GaussianMixture", "gmm")),
    **dict.fromkeys(("flow", "maskedaffineflow"), ("MaskedAffineFlow", "flow")),
    **dict.fromkeys(("spline", "splineflow"), ("SplineFlow", "spline")),
}
"""Names that models have elsewhere -> the model, and the settings file that trains it."""
OWN = {
    "data": ("descentflow.training.datamodule", "DescentDataModule"),
    "scores": ("descentflow.training.callbacks.score_callback", "ScoreCallback"),
}
"""Sections of the command line whose options are the arguments of one class of this package."""
SECTIONS_OF_CLASSES = (*OWN, "model")
NOTHING = "null"
"""Spellings of None in YAML and on the command line; the full parser lets them pass where a number is expected."""
SETTINGS = ("data", "trainer", "scores", "checkpoint")
"""Sections that take a file of settings where they are given a value themselves."""
DESCENTS = ("descents", "aircraft", "bada_dir", "checkpoint", "typecodes")
"""Options of the data that say which flights are fitted, with whose coefficients."""
SETTINGS_FILES = (".yaml", ".yml", ".json")


def check_words(command: str, words: Sequence[str]) -> dict[str, str]:
    """Refuse what cannot be an option, a model or a settings file.

    Args:
        command: ``fit``, ``validate``, ``test`` or ``predict``.
        words: The words after it.

    Returns:
        Options with their values, as far as they are looked at here; none where help is asked for.

    Raises:
        ConfigError: With the valid names and the nearest of them.

    Example:
        >>> check_words("fit", ["--model", "Gausian", "--data.descents", "descents.parquet"])
        Traceback (most recent call last):
        descentflow.core.errors.ConfigError: no model Gausian; expected ...; to mend it, did you mean Gaussian?
    """
    # What `--NAME+` adds to a list is one of its values.
    options = [
        (name.removesuffix("+"), "" if name.endswith("+") else value)
        for name, value in (_named(words, place) for place in range(len(words)) if words[place].startswith("--"))
    ]
    from_files = [option for name, value in options if name == "config" for option in _in_file(config_file(value))]
    # What stands later counts; a file's model is replaced by the one that is named.
    models = [value for name, value in from_files + options if name == "model"]
    if "model" in dict(options):
        from_files = [(name, value) for name, value in from_files if not name.startswith("model")]
    for name, value in from_files + options:
        _check_name(name, value, models[-1] if models else None)
        if name == "model":
            _check_model(value)
        if name in SETTINGS:
            _check_settings(name, value)
    given = {name for name, _ in options}
    asks = any(name.rpartition(".")[2] in ("help", "help_all", "print_config") for name in given)
    if command == "fit" and "config" not in given and not asks:
        _check_complete(given)
    return {} if asks else dict(from_files + options)


def models_named(words: Sequence[str]) -> tuple[str, ...]:
    """Models of this package that the words and their settings files name; all where they may name another.

    Args:
        words: Those after ``fit``, ``validate``, ``test`` or ``predict``, as :func:`check_words` has let them pass.

    Returns:
        Names of classes: all of them for help, for a file of a model's settings and for a class of the user's own.

    Raises:
        ConfigError: If a settings file cannot be read.

    Example:
        >>> models_named(["--config", "flow", "--model", "Gaussian"])
        ('Gaussian', 'MaskedAffineFlow')
        >>> models_named(["--model", "mine.Model"]) == MODELS
        True
    """
    options = [_named(words, place) for place in range(len(words)) if words[place].startswith("--")]
    files = [config_file(value) for name, value in options if name == "config"]
    paths = [value for name, value in options if name in ("model", "model.class_path")]
    for section in (read_settings(file).get("model") for file in files):
        if section is not None:
            paths.append(str(section.get("class_path") if isinstance(section, dict) else section))
    own = {path.removeprefix("descentflow.training.models.") for path in paths}
    asks = any(name.rpartition(".")[2] in ("help", "help_all", "print_config") for name, _ in options)
    return tuple(sorted(own)) if own and own <= set(MODELS) and not asks else MODELS


def _named(words: Sequence[str], position: int) -> tuple[str, str]:
    name, equals, value = words[position][2:].partition("=")
    following = words[position + 1] if position + 1 < len(words) else ""
    return name, value if equals else following


def _in_file(file: Path) -> list[tuple[str, str]]:
    """Options of a file of settings, as if it stood on the command line; the model by its class's name."""
    found = []
    for section, content in read_settings(file).items():
        _check_section(file, str(section), content)
        inside = content if isinstance(content, dict) else {}
        if section == "model":
            found.append(("model", str(inside.get("class_path", content)).rpartition(".")[2]))
            options = inside.get("init_args")
            inside = options if isinstance(options, dict) else {}
        if section in SECTIONS_OF_CLASSES:
            found += [(f"{section}.{name}", _value(section, name, value)) for name, value in inside.items()]
        else:
            found.append((str(section), ""))
    return found


def _value(section: str, name: Any, value: Any) -> str:
    """Descents that a settings file names, and nothing else of it."""
    if value is None:
        return NOTHING
    return value if section == "data" and name in DESCENTS and isinstance(value, str) else ""


def _check_section(file: Path, section: str, content: Any) -> None:
    """Refuse a section of a settings file that holds a value where it should hold settings, or name a file of them."""
    is_file = isinstance(content, str) and Path(content).suffix in SETTINGS_FILES
    if section in SETTINGS and not isinstance(content, dict) and not is_file:
        raise ConfigError(
            f"{file}: {section} is {str(content)[:60]}",
            expected="settings by name, or the name of a YAML file of them",
            mend=f"write lines of `NAME: VALUE` indented under `{section}:`, or leave the section out",
        )


def _check_complete(given: set[str]) -> None:
    lacking = [
        option
        for option, spellings in (
            ("--model", {"model", "model.class_path"}),
            ("--data.descents", {"data", "data.descents"}),
        )
        if not given & spellings
    ]
    if lacking:
        raise ConfigError(
            f"fit without {' and '.join(lacking)}",
            expected=f"--model NAME ({', '.join(MODELS)}) and --data.descents FILE, or --config FILE",
            mend="name them, for instance: descentflow fit --model Gaussian --data.descents descents.parquet",
        )


def _check_name(name: str, value: str, model: str | None) -> None:
    section, _, rest = name.partition(".")
    _known(f"no option --{name}", section, TOP, "--")
    first = rest.removeprefix("init_args.").partition(".")[0]
    source = OWN.get(section)
    if section == "model" and model in MODELS:
        source = (f"descentflow.training.models.{MODULES[model]}", model)
    if source is None or not first:
        return
    own = ("help",) if section in OWN else ("init_args", "class_path", "help")
    arguments = _arguments(*source)
    _known(f"no option --{name}", first, (*arguments, *own), f"--{section}.")
    if value == NOTHING and not arguments.get(first, True):
        raise ConfigError(
            f"--{name} {NOTHING}",
            expected="a value of its own type",
            mend="leave the option out for its default, or see `descentflow fit --help`",
        )
    kinds = _kinds(*source).get(rest.removeprefix("init_args."), ())
    if is_wrong(value, kinds):
        raise ConfigError(
            f"--{name} is {value}", expected=in_words(kinds), mend=how_to_write(f"--{name}", value, kinds)
        )


def _check_model(value: str) -> None:
    """A short name, the path of a class of the user's own, or a YAML file of its settings."""
    if "." in value or "/" in value or _is_file(value) or value.startswith("{"):
        return
    named = OTHER_NAMES.get(value.lower())
    if named is not None and value not in MODELS:
        kind, file = named
        python = f"; {value} is what df.fit(..., model=...) takes in Python" if value in IN_PYTHON else ""
        raise ConfigError(
            f"no model {value}",
            expected=f"one of {', '.join(MODELS)}",
            mend=f"write --model {kind}, or --config {file} for the settings that go with it{python}",
        )
    _known(f"no model {value}", value, MODELS, "")


def _check_settings(section: str, value: str) -> None:
    """Refuse what is no file of settings, for instance a checkpoint or descents; in a file, sections have no value."""
    if not value or value.startswith(("{", "--", "null")) or Path(value).suffix in SETTINGS_FILES:
        return
    instead = {
        "checkpoint": "to go on from a checkpoint, pass --ckpt_path FILE; each fit writes its own under runs",
        "data": "pass --data.descents FILE",
    }
    raise ConfigError(
        f"--{section} {value}",
        expected=f"a YAML file of settings, or single ones as --{section}.NAME VALUE",
        mend=instead.get(section, f"pass --{section}.NAME VALUE"),
    )


def _known(shown: str, name: str, names: Iterable[str], prefix: str) -> None:
    names = list(names)
    if name in names:
        return
    near = nearest(name, names)
    raise ConfigError(
        shown,
        expected=f"one of {', '.join(prefix + valid for valid in sorted(names))}",
        mend=f"did you mean {prefix}{near}?" if near else "see `descentflow fit --help`",
    )


@cache
def _kinds(module: str, name: str) -> dict[str, tuple[str, ...]]:
    """Arguments of a class's constructor, from its source, with the names of the types that they take."""
    # Finding a module imports the packages that it lies in, and these are light.
    spec = find_spec(module)
    if spec is None or spec.origin is None:
        raise ModuleNotFoundError(module)
    tree = ast.parse(Path(spec.origin).read_text(encoding="utf-8"))
    found = next(node for node in tree.body if isinstance(node, ast.ClassDef) and node.name == name)
    start = next(node for node in found.body if isinstance(node, ast.FunctionDef) and node.name == "__init__")
    return {one.arg: _types(one.annotation) for one in [*start.args.args[1:], *start.args.kwonlyargs]}


def _types(annotation: ast.expr | None) -> tuple[str, ...]:
    if annotation is None:
        return ()
    if isinstance(annotation, ast.BinOp):
        return (*_types(annotation.left), *_types(annotation.right))
    is_none = isinstance(annotation, ast.Constant) and annotation.value is None
    return ("NoneType",) if is_none else (ast.unparse(annotation),)


def _arguments(module: str, name: str) -> dict[str, bool]:
    """Arguments of a class's constructor, and whether they may be None."""
    return {one: not kinds or "NoneType" in kinds for one, kinds in _kinds(module, name).items()}


def _is_file(name: str) -> bool:
    try:
        return Path(name).is_file()
    except (OSError, ValueError):  # too long for a file's name, or with a zero byte in it
        return False
