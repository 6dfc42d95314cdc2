"""Kinds of files that are known by their first bytes and not read: what each is, and what the user can do."""

import re

from descentflow.core.errors import DataError
from descentflow.surveillance.formats.known_formats import ACCEPTED

PICKLE = ("a pickle", "write the table as Parquet: opening a pickle runs whatever code it holds")
PACKED = "unpack it, or pack it with gzip"
CAPTURE = ("a capture of network packets", "take the payloads out of the packets first")
BEAST = ("Beast binary", "write it as lines of time and frame, or as JSON with jet1090")
EXCEL = ("a workbook of Excel", "save the sheet as CSV in UTF-8, with commas and decimal points")
POINTS_MEND = "compare times between levels by the recipe of the docs (Times from so6 and ALL_FT+)"
BINARY = {
    rb"\x80[\x02-\x05]": PICKLE,
    rb"PK\x03\x04.*data\.pkl": (
        "a checkpoint or another file of torch",
        "pass the rows; info, sample, evaluate and diagnose take checkpoints",
    ),
    rb"PK\x03\x04.*(?:\[Content_Types\]\.xml|docProps/|xl/)": EXCEL,
    rb"PK\x03\x04": ("a zip archive", "unpack it and pass the folder"),
    rb"BZh": ("bzip2", PACKED),
    rb"\xfd7zXZ": ("xz", PACKED),
    rb"\x28\xb5\x2f\xfd": ("zstandard", PACKED),
    rb"\x89HDF": ("HDF5", "write the table as Parquet"),
    rb"FEA1": ("Feather version 1", "write it again as Feather version 2 or Parquet"),
    rb"\xd4\xc3\xb2\xa1|\xa1\xb2\xc3\xd4|\x0a\x0d\x0d\x0a": CAPTURE,
    rb"\x1a[1-3]": BEAST,
    rb"\xff\xfe|\xfe\xff": (
        "text in UTF-16, not UTF-8",
        "save it as UTF-8, for instance in an editor or by iconv -f UTF-16 -t UTF-8",
    ),
}
"""Begin of a file -> what it is, and what the user can do; the first that fits counts."""
TEXT = {
    rb"(?:\S+[ \t]+){4}(?:\d+[ \t]+){5}\S+(?:[ \t]+\d+){2}(?:[ \t]+\S+){8}[ \t]*[\r\n]": (
        "so6 of EUROCONTROL, with times and altitudes but no airspeeds",
        POINTS_MEND,
    ),
    rb"\d{1,2}[ \t]*\r?\n(?:[^;\n]*;){20}": (
        "ALL_FT+ of EUROCONTROL, with times and altitudes but no airspeeds",
        POINTS_MEND,
    ),
    rb"(?:MSG|SEL|ID|AIR|STA|CLK),\d*,\d*,\d*,[0-9A-Fa-f]*,": (
        "a BaseStation (SBS-1) log, whose messages have no IAS and no Mach",
        "record raw frames with jet1090, or snapshots (aircraft.json) of readsb or dump1090-fa",
    ),
    rb"(?:[*:]|@[0-9a-fA-F]{12})?(?:[0-9a-fA-F]{14}){1,2};?\s": (
        "Mode S frames without the time of each",
        "record lines `seconds frame` (seconds since 1970), for instance with jet1090",
    ),
    rb"[^\n]*\r[^\n]+\Z": (
        "text whose lines end in CR alone",
        r"write the line ends as LF, for instance by tr '\r' '\n' < OLD > NEW",
    ),
}
"""The same of texts, without byte order mark and blanks before them; JSON is not looked at."""


def refuse_known(begin: bytes, kinds: dict[bytes, tuple[str, str]], label: str) -> None:
    """Refuse a file that begins as one of these kinds.

    Args:
        begin: First bytes.
        kinds: :data:`BINARY` or :data:`TEXT`.
        label: Name of the file in messages.

    Raises:
        DataError: If it does.

    Example:
        >>> refuse_known(b"MSG,3,1,1,4CA001,1,2024/03/01,10:00:00.000", TEXT, "today.txt")
        Traceback (most recent call last):
        descentflow.core.errors.DataError: today.txt is a BaseStation (SBS-1) log, whose messages have no IAS ...
    """
    for pattern, (what, mend) in kinds.items():
        if re.match(pattern, begin, re.DOTALL):
            raise DataError(f"{label} is {what}", expected=ACCEPTED, mend=mend)
