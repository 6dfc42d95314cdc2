"""The table of formats: to add a source of rows, write its file in this folder and enter it here."""

from descentflow.core.errors import ConfigError
from descentflow.surveillance.formats import (
    aircraft_json,
    asterix,
    json_rows,
    mode_s_frames,
    readsb_trace,
    scat,
    tables,
)
from descentflow.surveillance.formats.file_format import FileFormat, Format, JsonFormat, TextFormat

KNOWN = (
    FileFormat(
        "parquet",
        any_columns=True,
        recognise=tables.is_parquet,
        read=tables.parquet,
    ),
    FileFormat(
        "feather",
        any_columns=True,
        recognise=tables.is_feather,
        read=tables.feather,
    ),
    TextFormat(
        "csv",
        any_columns=True,
        recognise=tables.may_be_csv,
        read=tables.csv,
    ),
    JsonFormat(
        "json-rows",
        any_columns=True,
        recognise=json_rows.is_rows,
        read=json_rows.rows,
    ),
    JsonFormat(
        "readsb-trace",
        join=readsb_trace.joined,
        recognise=readsb_trace.is_trace,
        read=readsb_trace.rows,
    ),
    JsonFormat(
        "aircraft-json",
        recognise=aircraft_json.is_snapshot,
        read=aircraft_json.rows,
    ),
    JsonFormat(
        "jet1090",
        recognise=mode_s_frames.is_message,
        read=mode_s_frames.jet1090,
    ),
    TextFormat(
        "modes-hex",
        recognise=mode_s_frames.begins_with_frames,
        read=mode_s_frames.lines,
    ),
    JsonFormat(
        "scat",
        recognise=scat.is_flight,
        read=scat.rows,
    ),
    FileFormat(
        "asterix",
        recognise=asterix.is_asterix,
        read=asterix.rows,
    ),
)
"""The formats. They are tried in this order, but those of any columns after all others: what they recognise is least
specific."""
FORMATS = {one.name: one for one in KNOWN}
"""Name -> format; each is also read from gzip and tar archives."""
HELD_TABLE = Format("table", any_columns=True)
"""Rows that are no file."""
ACCEPTED = f"one of {', '.join(FORMATS)} (docs: Sources of rows)"
"""List of accepted files, for messages."""


def check_format(name: str | None) -> None:
    """Refuse the name of an unknown format.

    Raises:
        ConfigError: Naming the known ones.

    Example:
        >>> check_format("parquet")
    """
    if name is not None and name not in FORMATS:
        raise ConfigError(
            f"no format {name!r}",
            expected=f"one of {', '.join(FORMATS)}",
            mend="name one of these, or none so that the format is recognised from the content",
        )
