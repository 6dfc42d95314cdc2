"""Raw Mode S: lines of jet1090, lines or tables of times and frames, and the rows that messages of many aircraft make.

A row is made of a heading and speed report (BDS 6,0), at most one a second: such a report has IAS and Mach of one
moment. Other values (altitude, BDS 4,0 and 5,0, ADS-B position and velocity) are taken from messages near that moment,
the altitude by interpolation. Sources: ICAO Doc 9871 (registers) and the field names of jet1090, which messages have.
"""

import itertools
import re
from collections.abc import Iterable, Iterator
from typing import Any

import polars as pl

from descentflow.core.errors import DataError
from descentflow.core.tabular import optional_library
from descentflow.surveillance.formats.json_rows import Kinds, is_number, table
from descentflow.surveillance.rows._times import in_seconds, timestamps
from descentflow.surveillance.rows._values_of_other_rows import NEAR_S, between, near
from descentflow.surveillance.rows.air_data import cas_of_mach_kt
from descentflow.surveillance.rows.drop_report import DropReport
from descentflow.surveillance.rows.schema import POSSIBLE
from descentflow.surveillance.unpacking import Input

CLOCK_S = 1.0
"""At most one row in this time: several radars ask, but within a second nothing relevant to a descent changes."""
WITHIN_S = {"turns": NEAR_S, "velocity": NEAR_S, "position": NEAR_S, "selected": 30.0, "callsign": 600.0}
"""Largest distance in time of other reports from a row; radars ask for registers every 4 to 12 s."""
CONTEXT_S = 30.0
"""Seconds of one batch of messages that are kept for the next."""
HOLD_S = 10.0
"""Rows within this time of a batch's end wait for the next batch."""
MAX_CAS_DIFFERENCE = 0.03
"""Relative difference of IAS and the CAS of Mach up to which bits that may be BDS 5,0 or 6,0 are taken for 6,0.

Replies that can only be 6,0 agree within 0.013 (4,688 seconds of an A319 over France)."""
MIN_REPLIES = 5
"""Fewest replies of an address without squitters: bit errors make false addresses, but rarely the same twice."""

Message = dict[str, Any]


def columns_of(messages: list[Message]) -> pl.DataFrame:
    """Messages as columns; names of fields are those of jet1090 and rs1090."""
    register = pl.col("bds")
    position = (register == "05") & (pl.col("source") == "barometric")
    velocity = register == "09"
    sixty, fifty = (pl.col(name).struct.field for name in ("bds60", "bds50"))
    return table(messages, MESSAGE_KINDS).select(
        in_seconds(pl.col("timestamp")).alias("time"),
        pl.col("icao24").str.strip_chars().replace("", None),
        pl.col("df").is_in(PROTECTED).fill_null(False).alias("protected"),
        pl.when(position | pl.col("df").is_in(ALTITUDE_REPLIES)).then("altitude").alias("altitude"),
        *(sixty(name) for name in ("IAS", "Mach", "heading")),
        sixty("vrate_barometric").alias("rate"),
        *(fifty(name) for name in ("TAS", "roll")),
        *(fifty(name).alias(f"{name}50") for name in ("groundspeed", "track")),
        pl.col("bds40").struct.field("selected_mcp").alias("selected_altitude"),
        *(pl.when(velocity).then(name).alias(name) for name in ("groundspeed", "track")),
        pl.when(velocity).then("vertical_rate").alias("squittered_rate"),
        pl.when(velocity & (pl.col("frame").str.len_chars() == 28)).then(OF_PRESSURE).alias("barometric"),
        *(pl.when(position).then(name).alias(name) for name in ("latitude", "longitude")),
        pl.coalesce("callsign", pl.col("bds20").struct.field("callsign")).str.strip_chars().alias("callsign"),
    )


PROTECTED = ("17", "18")
"""Downlink formats whose parity protects the address; in others it is mixed with an address or interrogator."""
ALTITUDE_REPLIES = ("0", "4", "16", "20")
"""Downlink formats with a pressure altitude."""
NUMBER, TEXT = pl.Float64(), pl.String()
MESSAGE_KINDS: Kinds = {
    **dict.fromkeys(
        ("timestamp", "altitude", "groundspeed", "track", "vertical_rate", "latitude", "longitude"), NUMBER
    ),
    **dict.fromkeys(("icao24", "df", "bds", "source", "frame", "callsign"), TEXT),
    "bds60": pl.Struct(dict.fromkeys(("IAS", "Mach", "heading", "vrate_barometric"), NUMBER)),
    "bds50": pl.Struct(dict.fromkeys(("TAS", "roll", "groundspeed", "track"), NUMBER)),
    "bds40": pl.Struct({"selected_mcp": NUMBER}),
    "bds20": pl.Struct({"callsign": TEXT}),
}
OF_PRESSURE = pl.col("frame").str.slice(16, 1).str.to_lowercase().is_in(list("13579bdf"))
"""True if a squittered rate is barometric: bit 36 of the message, as dump1090 reads it.

The decoder's own field for it (`vrate_src`, rs1090 0.7.0) has the two interchanged.
"""


def rows(batches: Iterable[pl.DataFrame], report: DropReport) -> Iterator[pl.DataFrame]:
    """Rows of batches of messages that are roughly in order of time; each batch leaves some context for the next."""
    kept: pl.DataFrame | None = None
    known: set[str] = set()
    for batch in batches:
        fresh = batch.drop_nulls(["time", "icao24"]).with_columns(age=pl.lit(0))
        report.note("Mode S messages without a time or address", len(batch) - len(fresh))
        messages = fresh if kept is None else pl.concat([kept, fresh])
        # A single clock error must not say how far the batch reaches.
        reach = messages["time"].tail(1000).median()
        until = float(reach) - HOLD_S if isinstance(reach, float) else 0.0
        known |= set(messages.filter("protected")["icao24"])
        due = (pl.col("age") == 1) | ((pl.col("age") == 0) & (pl.col("time") <= until))
        yield _rows_of(messages, due, known, report)
        kept = messages.with_columns(age=pl.when(due).then(2).otherwise(pl.col("age") + 1)).filter(
            (pl.col("age") == 1) | pl.col("time").is_between(until - CONTEXT_S, until)
        )
    if kept is not None:
        yield _rows_of(kept, pl.col("age") == 1, known, report)


def _rows_of(messages: pl.DataFrame, due: pl.Expr, known: set[str], report: DropReport) -> pl.DataFrame:
    """Rows at those reports of BDS 6,0 that are due, with the values of other messages near them."""
    counts = messages["icao24"].value_counts().filter(pl.col("count") >= MIN_REPLIES)
    trusted = pl.col("icao24").is_in([*known, *counts["icao24"]])
    report.note(
        "Mode S messages of addresses that hardly appear (bit errors)", messages.select((~trusted & due).sum()).item()
    )
    ordered = messages.with_columns(due=due).filter(trusted).sort("time", maintain_order=True)
    reports = ordered.filter(pl.col("IAS").is_not_null() & pl.col("due"))
    possible = between(reports, ordered)
    sure = possible.filter(pl.col("TAS").is_null() | _agrees(possible))
    report.note("Mode S replies that may be BDS 5,0 or 6,0 and fit neither", len(possible) - len(sure))
    chosen = sure.filter(pl.struct("icao24", (pl.col("time") / CLOCK_S).floor()).is_first_distinct())
    report.note("BDS 6,0 reports within the same second as another", len(sure) - len(chosen))
    chosen = chosen.select("time", "icao24", "altitude", "IAS", "Mach", "heading", "rate")
    certain = pl.col("IAS").is_null()
    turn = ordered.filter(pl.col("TAS").is_not_null() & certain)
    chosen = near(chosen, turn.select("time", "icao24", "TAS", "roll", "groundspeed50", "track50"), WITHIN_S["turns"])
    velocity = ordered.filter(pl.col("groundspeed").is_not_null() | pl.col("squittered_rate").is_not_null())
    chosen = near(
        chosen,
        velocity.select("time", "icao24", "groundspeed", "track", "squittered_rate", "barometric"),
        WITHIN_S["velocity"],
    )
    for kind, names in OTHER_VALUES.items():
        # A callsign or selection is valid until the next.
        strategy: Any = "backward" if kind in ("selected", "callsign") else "nearest"
        chosen = near(chosen, ordered.select("time", "icao24", *names).drop_nulls(), WITHIN_S[kind], strategy)
    return chosen.select(
        pl.col("time").alias("timestamp"),
        "icao24",
        "callsign",
        "altitude",
        pl.coalesce("rate", pl.when("barometric").then("squittered_rate")).alias("vertical_rate"),
        pl.when(~pl.col("barometric")).then("squittered_rate").alias("geometric_rate"),
        "IAS",
        "Mach",
        "TAS",
        pl.coalesce("groundspeed", "groundspeed50").alias("groundspeed"),
        pl.coalesce("track", "track50").alias("track"),
        "heading",
        "roll",
        "latitude",
        "longitude",
        "selected_altitude",
    )


OTHER_VALUES = {"position": ("latitude", "longitude"), "selected": ("selected_altitude",), "callsign": ("callsign",)}


def _agrees(reports: pl.DataFrame) -> pl.Series:
    """Test for IAS and Mach that agree at the altitude; false where it is missing or either is impossible."""
    possible = [pl.col(name).is_between(*POSSIBLE[name]).fill_null(False) for name in ("altitude", "IAS", "Mach")]
    usable = reports.select(pl.when(pl.all_horizontal(possible)).then(pl.col("altitude", "IAS", "Mach")).fill_null(0.0))
    altitude, ias, mach = (usable[name].to_numpy() for name in ("altitude", "IAS", "Mach"))
    cas = cas_of_mach_kt(mach, altitude)
    return pl.Series((abs(ias - cas) <= MAX_CAS_DIFFERENCE * cas) & (mach > 0), dtype=pl.Boolean)


BATCH_MESSAGES = 100_000
"""Messages that are joined at a time."""
HEX_FRAME = r"^[0-9a-fA-F]{14}(?:[0-9a-fA-F]{14})?$"
WHOLE_FRAME = re.compile(HEX_FRAME)
TIME_AND_FRAME = re.compile(rb"^\s*\"?(\d+(?:\.\d*)?)\"?[\s,;]+\"?\*?((?:[0-9a-fA-F]{14}){1,2});?\"?\s*$")
"""A time in seconds since 1970 and a frame, with blanks, a comma or a semicolon between them; a `*` and `;` around the
frame are AVR's."""
LINES_READ = "lines `seconds frame` or `seconds,frame`, seconds since 1970 and frames of 14 or 28 hexadecimal digits"


def is_message(document: object) -> bool:
    """Test for a JSON document that looks like a line of jet1090, or of pyModeS 3."""
    return isinstance(document, dict) and "timestamp" in document and bool(document.keys() & {"frame", "df", "raw_msg"})


def jet1090(documents: Iterator[object], label: str, report: DropReport, block_rows: int) -> Iterator[pl.DataFrame]:
    """Rows of jet1090's lines: as decoded by the receiver, or decoded here where a line has only time and frame.

    Lines of pyModeS 3, whose fields have other names, are decoded anew from their `raw_msg`.
    """

    def batches() -> Iterator[pl.DataFrame]:
        while some := list(itertools.islice(documents, BATCH_MESSAGES)):
            messages = [m for m in some if isinstance(m, dict) and is_number(m.get("timestamp"))]
            report.note("lines that are no message with a time", len(some) - len(messages))
            done = [m for m in messages if "df" in m and "icao" not in m]
            if len(done) < len(messages):
                rest = [(m.get("frame", m.get("raw_msg")), m) for m in messages if "df" not in m or "icao" in m]
                raw = [(f, float(m["timestamp"])) for f, m in rest if isinstance(f, str) and WHOLE_FRAME.fullmatch(f)]
                report.note("lines without fields or a frame of 14 or 28 hexadecimal digits", len(rest) - len(raw))
                if not done and not raw:
                    raise DataError(
                        f"{label}: lines without a frame, whose fields are not those of jet1090",
                        expected="fields as jet1090 names them, or `timestamp` with `frame` (`raw_msg` of pyModeS 3)",
                        mend="write the frame into each line, as pyModeS does in `raw_msg`, or record with jet1090",
                    )
                done += decoded([frame for frame, _ in raw], [time for _, time in raw], report)
            yield columns_of(done)

    yield from rows(batches(), report)


def lines(source: Input, report: DropReport, block_rows: int) -> Iterator[pl.DataFrame]:
    """Rows of lines of time and frame."""

    def batches() -> Iterator[pl.DataFrame]:
        read = (line for _, line in source.lines())
        first = True
        while batch := list(itertools.islice(read, BATCH_MESSAGES)):
            parts = [match.groups() for line in batch if (match := TIME_AND_FRAME.match(line))]
            if first and len(parts) < len(batch) / 2:
                raise DataError(
                    f"{source.label}: {len(batch) - len(parts)} of the first {len(batch)} lines are no time and frame",
                    expected=LINES_READ,
                    mend="write such lines, for instance with jet1090, readsb or dump1090 and a clock",
                )
            header = first and not TIME_AND_FRAME.match(batch[0])  # names of columns
            first = False
            report.note("lines that are no time and frame", len(batch) - len(parts) - header)
            frames = [frame.decode() for _, frame in parts]
            yield columns_of(decoded(frames, [float(time) for time, _ in parts], report))

    yield from rows(batches(), report)


def is_table(table: pl.DataFrame) -> bool:
    """Test for a table of times and undecoded frames, as OpenSky's replies and traffic's raw data are."""
    decoded_already = {name.lower() for name in table.columns} >= {"ias", "mach"}
    return not decoded_already and bool(_column(table, TIME_COLUMNS)) and bool(_column(table, FRAME_COLUMNS))


def of_tables(tables: Iterable[pl.DataFrame], report: DropReport) -> Iterator[pl.DataFrame]:
    """Rows of tables of times and frames."""

    def batches() -> Iterator[pl.DataFrame]:
        for messages in tables:
            time = timestamps(messages[_column(messages, TIME_COLUMNS)]).dt.epoch("us").cast(pl.Float64) / 1e6
            both = pl.DataFrame({"time": time, "frame": messages[_column(messages, FRAME_COLUMNS)].cast(pl.String)})
            usable = both.filter(pl.col("frame").str.contains(HEX_FRAME) & pl.col("time").is_not_null())
            report.note("rows without a time and a Mode S frame", len(both) - len(usable))
            for part in usable.iter_slices(BATCH_MESSAGES):
                yield columns_of(decoded(part["frame"].to_list(), part["time"].to_list(), report))

    yield from rows(batches(), report)


TIME_COLUMNS = ("mintime", "timestamp", "time")
FRAME_COLUMNS = ("rawmsg", "frame")
"""Names of the columns in OpenSky's tables, and in traffic's."""


def _column(table: pl.DataFrame, names: tuple[str, ...]) -> str:
    return next((name for name in names if name in table.columns), "")


def decoded(frames: list[str], times: list[float], report: DropReport) -> list[dict[str, Any]]:
    """Messages of frames whose parity is right."""
    decode = optional_library("rs1090", "modes").decode
    if not frames:
        return []
    # The decoder pairs positions by time in seconds, and would not survive other digits than those looked at.
    seconds = pl.DataFrame({"time": times}).select(in_seconds(pl.col("time"))).to_series().to_list()
    messages: list[Any] = decode(frames, seconds)
    report.note("Mode S frames that could not be decoded (parity or format)", len(frames) - len(messages))
    return messages


def begins_with_frames(head: bytes) -> bool:
    """Test for text that begins with lines of time and frame, under a line of names or not."""
    first = [line for line in head.splitlines()[:4] if line.strip()]
    return any(TIME_AND_FRAME.match(line) for line in first[:2])
