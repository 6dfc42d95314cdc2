"""Content of files, as a text to compare: checkpoints without the paths in them, everything else byte for byte."""

import hashlib
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import torch
import yaml

PATHS = ("dirpath", "best_model_path", "kth_best_model_path", "last_model_path")
"""Entries of a checkpoint that say where it lies."""
TEMPORARY = ("descentflow-part", ".work")


def contents(folder: Path, patterns: Iterable[str]) -> dict[str, str]:
    """Digest of each product, by its name in the folder; of several versions of a run, those of the last.

    What has no final name yet, a hidden file, is no product.

    Args:
        folder: Of the command.
        patterns: Of the products.
    """
    files = {path for pattern in patterns for path in folder.glob(pattern) if path.is_file() and path.name[0] != "."}
    shown: dict[str, str] = {}
    for path in sorted(files):  # version_0 before version_1: the later one replaces it
        name = "/".join("version" if part.startswith("version_") else part for part in path.relative_to(folder).parts)
        shown[name] = digest(path)
    return shown


def digest(path: Path) -> str:
    """Digest of what a file holds.

    Raises:
        Exception: If a checkpoint or a YAML file is not whole.
    """
    if path.suffix == ".ckpt":
        sha = hashlib.sha256()
        _add(torch.load(path, weights_only=True), sha)
        return sha.hexdigest()
    if path.name == "config.yaml":
        settings = yaml.safe_load(path.read_text())
        return repr({key: settings[key] for key in ("model", "data", "seed_everything")})
    return hashlib.sha256(path.read_bytes()).hexdigest()


def _add(tree: Any, found: Any) -> None:
    """Take nested entries into a digest in their order."""
    if isinstance(tree, torch.Tensor):
        found.update(f"{tree.dtype}{tuple(tree.shape)}".encode())
        found.update(tree.contiguous().numpy().tobytes())
    elif isinstance(tree, dict):
        for key, value in tree.items():
            found.update(f"|{key}:".encode())
            if key == "best_k_models":
                value = list(value.values())
            if key not in PATHS:
                _add(value, found)
    elif isinstance(tree, list | tuple):
        for value in tree:
            _add(value, found)
    else:
        found.update(repr(tree).encode())


def temporary(folder: Path) -> list[str]:
    """Names of what is left over."""
    left = [path for path in folder.rglob("*") if any(mark in path.name for mark in TEMPORARY) or path.name[0] == "."]
    return sorted(path.relative_to(folder).as_posix() for path in left)
