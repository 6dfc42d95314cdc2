"""Settings in YAML files, read by one loader wherever they are asked for."""

import re
from importlib import import_module
from pathlib import Path
from typing import Any

from descentflow.core.errors import ConfigError

EXPONENT = re.compile(r"[-+]?[0-9]+[eE][-+]?[0-9]+$")


def read_settings(path: Path) -> dict[str, Any]:
    """Read a YAML file of settings."""
    # A tenth of a second of imports that a command without a settings file need not pay.
    yaml: Any = import_module("yaml")
    loader: Any = type("Loader", (yaml.SafeLoader,), {})
    loader.add_implicit_resolver("tag:yaml.org,2002:float", EXPONENT, list("-+0123456789"))
    try:
        found = yaml.load(path.read_text(encoding="utf-8"), loader)
    except (OSError, ValueError, yaml.YAMLError, RecursionError) as error:
        reason = " ".join(str(error).split())
        raise ConfigError(
            f"{path}: {reason}", expected="a YAML file of settings", mend="correct what is named"
        ) from error
    if not isinstance(found, dict | None):
        raise ConfigError(
            f"{path} holds a {type(found).__name__}",
            expected="lines of `name: value`",
            mend="begin from a file that comes along, for instance configs/model/gaussian.yaml",
        )
    return found or {}


def settings_text(settings: dict[str, Any]) -> str:
    """Settings as YAML, in their order."""
    text: str = import_module("yaml").safe_dump(settings, sort_keys=False)
    return text
