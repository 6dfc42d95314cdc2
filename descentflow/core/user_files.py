"""Files of the user's own: Python with effects or a density, which is run, and settings in YAML, read by one loader."""

import re
import sys
import traceback
from collections.abc import Iterator
from contextlib import contextmanager
from importlib import import_module
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from types import ModuleType
from typing import Any

from descentflow.core.errors import ConfigError, DescentflowError


def module_of_file(path: str | Path, holds: str) -> ModuleType:
    """Run a Python file. Its module has a name by the file's, by which classes of it are found again."""
    source = Path(path)
    if not source.is_file() or source.suffix != ".py":
        what = "no Python file" if source.is_file() else "no such file"
        raise ConfigError(f"{source}: {what}", expected=f"a Python file with {holds}", mend="name the file (.py)")
    name = "descentflow_user_" + "".join(letter if letter.isalnum() else "_" for letter in source.stem)
    spec = spec_from_file_location(name, source)
    assert spec is not None
    assert spec.loader is not None
    module = module_from_spec(spec)
    # Dataclasses and pickles of the file look for their module by its name.
    sys.modules[name] = module
    try:
        spec.loader.exec_module(module)
    except Exception as error:
        raise failed(source, error) from error
    return module


@contextmanager
def lines_named(source: str | Path | None) -> Iterator[None]:
    """Errors that the code of a user's file raises become errors that name its line."""
    try:
        yield
    except DescentflowError:
        raise
    except Exception as error:
        if source is None or not _lines(Path(source), error):
            raise
        raise failed(Path(source), error) from error


def failed(source: Path, error: Exception) -> ConfigError:
    """An error of the user's file, with its own line."""
    lines = _lines(source, error)
    line = error.lineno if isinstance(error, SyntaxError) else (lines[-1] if lines else None)
    place = f"{source}" if line is None else f"{source}, line {line}"
    message = error.msg if isinstance(error, SyntaxError) else str(error)
    return ConfigError(
        f"{place}: {type(error).__name__}: {message}", expected="a file that runs", mend="correct that line"
    )


def _lines(source: Path, error: Exception) -> list[int | None]:
    """Lines of a file that an error came through, the last one last."""
    frames = traceback.extract_tb(error.__traceback__)
    return [frame.lineno for frame in frames if Path(frame.filename).absolute() == source.absolute()]


EXPONENT = re.compile(r"[-+]?[0-9]+[eE][-+]?[0-9]+$")


def read_settings(path: Path) -> dict[str, Any]:
    """Read a YAML file of settings."""
    # A tenth of a second of imports that a command without a settings file need not pay.
    yaml: Any = import_module("yaml")
    loader: Any = type("Loader", (yaml.SafeLoader,), {})
    loader.add_implicit_resolver("tag:yaml.org,2002:float", EXPONENT, list("-+0123456789"))
    try:
        settings = yaml.load(path.read_text(encoding="utf-8"), loader)
    except (OSError, ValueError, yaml.YAMLError, RecursionError) as error:
        reason = " ".join(str(error).split())
        raise ConfigError(
            f"{path}: {reason}", expected="a YAML file of settings", mend="correct what is named"
        ) from error
    if not isinstance(settings, dict | None):
        raise ConfigError(
            f"{path} holds a {type(settings).__name__}",
            expected="lines of `name: value`",
            mend="begin from a file that comes along, for instance configs/model/gaussian.yaml",
        )
    return settings or {}


def settings_text(settings: dict[str, Any]) -> str:
    """Settings as YAML, in their order."""
    text: str = import_module("yaml").safe_dump(settings, sort_keys=False)
    return text
