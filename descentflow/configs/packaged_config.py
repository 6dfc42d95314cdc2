"""Settings files that come with the package, found by name wherever the program is called from."""

from pathlib import Path

from descentflow.core.errors import ConfigError, nearest

FOLDER = Path(__file__).resolve().parent


def packaged_configs() -> dict[str, Path]:
    """Every settings file that comes with the package, by its name without the suffix.

    Returns:
        Name to file.

    Example:
        >>> " ".join(sorted(packaged_configs()))
        'default flow flow_paper gaussian gaussian_paper gmm gmm_paper gmm_svi paper quickstart'
    """
    return {path.stem: path for path in sorted(FOLDER.rglob("*.yaml"))}


def config_file(name: str | Path) -> Path:
    """Find a settings file: a file of the user's own, or else one that comes with the package.

    Args:
        name: A path; or a packaged file, as ``flow``, ``model/flow.yaml`` or ``configs/model/flow.yaml``.

    Returns:
        The file.

    Raises:
        ConfigError: If there is no such file.

    Example:
        >>> config_file("flow") == config_file("configs/model/flow.yaml")
        True
    """
    own = Path(name)
    if own.is_file():
        return own
    parts = (*own.parts[:-1], own.stem) if own.name else ()
    for path in packaged_configs().values():
        inside = ("configs", *path.relative_to(FOLDER).with_suffix("").parts)
        if parts and inside[-len(parts) :] == parts:
            return path
    near = nearest(own.stem, packaged_configs())
    raise ConfigError(
        f"no settings file {name}",
        expected=f"a YAML file, or one that comes along: {', '.join(packaged_configs())}",
        mend=f"did you mean {near}? Else check the path" if near else "check the path",
    )
