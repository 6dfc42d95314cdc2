"""Sealing: what was written before is proved by its hash, published before anyone could have known the answer."""

import hashlib
import json
import time
from pathlib import Path
from typing import Any

from descentflow.core.errors import DataError
from descentflow.core.files import write_whole
from studies.blind_diagnosis.blind_plan import Plan

KEY, MANIFEST, DIAGNOSES, OPENED = "sealed_key.json", "manifest.json", "diagnoses.json", "opened.json"
"""Files of a study: the key, what is public before diagnosis, the diagnoses' hashes, and when the key was opened."""


def write_json(path: Path, content: Any) -> None:
    """Write JSON, whole or not at all.

    Args:
        path: The file.
        content: Primitives; keys are sorted, so that one content is one file and has one hash.

    Raises:
        ValueError: If a number is not finite.
        DataError: If the file's folder does not exist.

    Example:
        >>> write_json(Path("small.json"), {"b": 1, "a": 2})
        >>> Path("small.json").read_text().split()
        ['{', '"a":', '2,', '"b":', '1', '}']
    """
    write_whole(path, json.dumps(content, indent=1, sort_keys=True, allow_nan=False))


def read_json(path: Path) -> Any:
    """Read JSON.

    Raises:
        DataError: If the file is missing or damaged.

    Example:
        >>> read_json(Path("no_study/manifest.json"))
        Traceback (most recent call last):
            ...
        descentflow.core.errors.DataError: ...no_study/manifest.json...
    """
    try:
        return json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise DataError(
            f"{path}: {error}", expected="a file of this study", mend="run the study's earlier steps first"
        ) from error


def digest(path: Path) -> str:
    """SHA-256 of a file.

    Example:
        >>> _ = Path("empty").write_bytes(b"")
        >>> digest(Path("empty"))[:16]
        'e3b0c44298fc1c14'
    """
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def seal_key(folder: Path, plan: Plan) -> str:
    """Write the key and return its hash, which the manifest publishes.

    Example:
        >>> seal_key(Path("."), Plan(0, "00", (), ())) == digest(Path(KEY))
        True
    """
    write_json(folder / KEY, plan.as_dict())
    return digest(folder / KEY)


def seal_diagnoses(folder: Path, names: list[str]) -> int:
    """Record the hash of every diagnosis that is there; what is recorded once is not recorded again.

    Raises:
        DataError: If a diagnosis was changed since it was recorded.

    Example:
        >>> Path("sealed/diagnoses").mkdir(parents=True)
        >>> write_json(Path("sealed/diagnoses/blind_0000.json"), {"report": None})
        >>> seal_diagnoses(Path("sealed"), ["blind_0000", "blind_0001"])  # the other is not there yet
        1
        >>> write_json(Path("sealed/diagnoses/blind_0000.json"), {"report": {"verdict": "none"}})
        >>> seal_diagnoses(Path("sealed"), ["blind_0000"])
        Traceback (most recent call last):
            ...
        descentflow.core.errors.DataError: ...blind_0000.json is not the diagnosis that was sealed...
    """
    path = folder / DIAGNOSES
    known: dict[str, str] = read_json(path) if path.is_file() else {}
    for name in names:
        file = folder / "diagnoses" / f"{name}.json"
        if not file.is_file():
            continue
        sha = digest(file)
        if known.setdefault(name, sha) != sha:
            raise DataError(
                f"{file} is not the diagnosis that was sealed", expected=known[name], mend="run the study afresh"
            )
    write_json(path, known)
    return len(known)


def open_key(folder: Path) -> tuple[Plan, dict[str, Any], dict[str, Any]]:
    """Open the key after everything that was sealed proves unchanged, and note when that was done first.

    From then on nothing is diagnosed any more, see :func:`refuse_if_open`.

    Returns:
        The key, the manifest, and the sealed diagnoses by the name of their job.

    Raises:
        DataError: If the key, a set of flights or a diagnosis is not what was sealed, or no diagnosis was sealed.

    Example:
        >>> folder, plan = Path("opened"), Plan(0, "00", (), ())
        >>> folder.mkdir()
        >>> write_json(folder / MANIFEST, {"key_sha256": seal_key(folder, plan), "jobs": []})
        >>> seal_diagnoses(folder, [])
        0
        >>> open_key(folder)[0] == plan
        True
    """
    manifest = read_json(folder / MANIFEST)
    if digest(folder / KEY) != manifest["key_sha256"]:
        raise DataError(
            f"{folder / KEY} is not the key that was sealed", expected=manifest["key_sha256"], mend="run a new study"
        )
    sealed = read_json(folder / DIAGNOSES)
    diagnoses: dict[str, Any] = {}
    for name, expected in sealed.items():
        file = folder / "diagnoses" / f"{name}.json"
        if not file.is_file() or digest(file) != expected:
            raise DataError(f"{file} is not the diagnosis that was sealed", expected=expected, mend="run a new study")
        diagnoses[name] = read_json(file)
    if not (folder / OPENED).is_file():
        at = time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime())
        write_json(folder / OPENED, {"opened_at": at, "diagnoses": len(diagnoses)})
    return Plan.from_dict(read_json(folder / KEY)), manifest, diagnoses


def refuse_if_open(folder: Path) -> None:
    """Refuse to diagnose what is not diagnosed yet, once the key was opened.

    Raises:
        DataError: If it was.

    Example:
        >>> Path("study_a").mkdir()
        >>> refuse_if_open(Path("study_a"))
        >>> write_json(Path("study_a") / OPENED, {"opened_at": "2026-01-01T00:00:00Z", "diagnoses": 0})
        >>> refuse_if_open(Path("study_a"))
        Traceback (most recent call last):
            ...
        descentflow.core.errors.DataError: ...opened at 2026-01-01T00:00:00Z...
    """
    if (folder / OPENED).is_file():
        raise DataError(
            f"the key of {folder} was opened at {read_json(folder / OPENED)['opened_at']}",
            expected="diagnoses before the key is opened",
            mend="run a new study",
        )
