"""Sets of flights whose cause is known: a folder of folders with both sides and the truth."""

import json
from dataclasses import dataclass
from pathlib import Path

import polars as pl

from descentflow.core.errors import DataError

KINDS = ("null", "single", "double", "outside")
FILES = ("real.parquet", "simulator.parquet", "truth.json")
BY_FLIGHT = "_own"
"""Ending of a planted effect that each flight has in its own way: it is the same effect."""


@dataclass(frozen=True)
class RivalSet:
    """Prepared descents of both sides, and what was planted into the real ones: nothing where the kind is null."""

    name: str
    kind: str
    typecode: str
    effects: frozenset[str]
    real: pl.DataFrame
    simulator: pl.DataFrame
    folder: Path


def set_folders(folder: Path, names: list[str] | None) -> list[Path]:
    """Folders of sets, those named or all.

    Raises:
        DataError: If there is none, or one that is named is not there.
    """
    found = {path.parent.name: path.parent for path in sorted(folder.glob("*/truth.json"))}
    strange = sorted(set(names or ()) - set(found))
    if not found or strange:
        raise DataError(
            f"no set {', '.join(strange) or 'at all'} in {folder}",
            expected=f"folders with {', '.join(FILES)}",
            mend="name another folder, or other sets",
        )
    return [found[name] for name in names] if names else list(found.values())


def read_set(folder: Path) -> RivalSet:
    """One set.

    Raises:
        DataError: If a file is missing, or the truth has no known kind.
    """
    missing = [name for name in FILES if not (folder / name).is_file()]
    if missing:
        raise DataError(f"{folder} lacks {', '.join(missing)}", expected=", ".join(FILES), mend="complete the set")
    truth = json.loads((folder / "truth.json").read_text())
    effects = frozenset(plain_name(name) for name in truth["effects"])
    kind = truth["kind"] or "null"
    if kind not in KINDS or (kind == "null") != (not effects):
        raise DataError(f"{folder}: kind {kind} with {sorted(effects)}", expected=", ".join(KINDS), mend="correct it")
    real, simulator = (pl.read_parquet(folder / name) for name in FILES[:2])
    return RivalSet(folder.name, kind, truth["typecode"], effects, real, simulator, folder)


def plain_name(planted: str) -> str:
    """Name of the catalogue for what was planted."""
    return planted.removesuffix(BY_FLIGHT)
