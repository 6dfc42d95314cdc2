"""The files that paths name: those of folders, and the parts of split archives together."""

import re
from collections.abc import Sequence
from itertools import groupby
from pathlib import Path

from descentflow.core.errors import DataError

COMPANION = re.compile(
    r"(^|/)(heatmap|acas)/"
    r"|(^|/)(readme|license|copying|notice|trace_recent_)[^/]*$"
    r"|(^|/)(receiver|stats|airspace|grib_meteo)\.json$"
    r"|(^|/)_(success|metadata|common_metadata|(committed|started)_[^/]*)$",
    re.IGNORECASE,
)
"""Names of what published archives and folders hold beside rows; `trace_recent` repeats the end of `trace_full`;
Spark and Trino leave `_SUCCESS` and the like."""
PART = re.compile(r"(?P<whole>.+\.(?:tar|tgz|tar\.gz))\.(?!gz$|xz$|lz$|zst$|lzo$)(?P<number>[a-z]{2,3}|\d{2,3})$")


def files_of(paths: Sequence[str | Path], accepted: str = "files or folders of rows") -> list[Path]:
    """The files given, and all files of the folders given except hidden ones and companions of published archives.

    Args:
        paths: Files and folders.
        accepted: Expected input, for the error.

    Raises:
        DataError: If a path does not exist, or no file is left.

    Example:
        >>> files_of(["rows.parquet"])
        [PosixPath('rows.parquet')]
    """
    files: list[Path] = []
    # A single name is a sequence, too: of letters.
    for path in map(Path, [paths] if isinstance(paths, str) else paths):
        if path.is_dir():
            inside = sorted(p for p in path.rglob("*") if p.is_file() and not p.name.startswith("."))
            files += [p for p in inside if not COMPANION.search(p.relative_to(path).as_posix())]
        elif path.is_file():
            files.append(path)
        else:
            raise DataError(f"no file or folder {path}", expected="one that is there", mend="check the path")
    if not files:
        raise DataError("no file in the folders given", expected=accepted, mend="pass files, or folders that hold some")
    return files


def with_parts(files: Sequence[Path]) -> list[tuple[str, list[Path]]]:
    """Files, with the parts of each split archive together (`split` names them .aa .ab ..., others .001 .002 ...).

    Raises:
        DataError: If a part is missing before or between others.

    Example:
        >>> with_parts([Path("day.tar.aa"), Path("day.tar.ab")])
        [('day.tar', [PosixPath('day.tar.aa'), PosixPath('day.tar.ab')])]
    """
    groups: dict[str, list[Path]] = {}
    for file in files:
        part = PART.match(str(file))
        groups.setdefault(part["whole"] if part else str(file), []).append(file)
    found: list[tuple[str, list[Path]]] = []
    for name, together in groups.items():
        if not PART.match(str(together[0])):
            found += [(name, [file]) for file in together]
            continue
        parts = [file for file, _ in groupby(sorted(together))]
        numbers = [_number(str(file)) for file in parts]
        first = 1 if str(parts[0])[-1].isdecimal() else 0
        if numbers[0] > first or numbers != list(range(numbers[0], numbers[0] + len(numbers))):
            raise DataError(
                f"parts {', '.join(file.name for file in parts)} of a split archive, but not those between or before",
                expected="all parts from the first",
                mend="pass the folder that holds them all",
            )
        found.append((name, parts))
    return found


def _number(part: str) -> int:
    suffix = part.rpartition(".")[2]
    if suffix.isdecimal():
        return int(suffix)
    number = 0
    for letter in suffix:
        number = 26 * number + ord(letter) - ord("a")
    return number
