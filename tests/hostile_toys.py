"""One small good file of every source, to be damaged, and what reading a file may end in."""

import io
import json
from collections.abc import Callable
from pathlib import Path

import polars as pl
from source_toys import all_call, cat048, cat062, packed, register_60, reply, scat_of, snapshots_of, tar_of, trace_of
from surveillance_toys import flight

from descentflow.core.errors import DataError
from descentflow.surveillance.read_rows import read_rows
from descentflow.surveillance.rows.drop_report import DropReport

FLIGHT = flight().head(60)


def as_bytes(write: Callable[[io.BytesIO], object]) -> bytes:
    content = io.BytesIO()
    write(content)
    return content.getvalue()


def frames() -> list[tuple[float, str]]:
    sent = []
    for row in FLIGHT.iter_rows(named=True):
        speeds = register_60(90.0, round(row["IAS"]), row["Mach"], row["vertical_rate"])
        time = row["timestamp"].timestamp()
        sent += [(time, all_call("4ca001")), (time, reply("4ca001", round(row["altitude"]), speeds))]
    return sent


def messages() -> list[dict]:
    """Lines as jet1090 decodes them."""
    fixed = {"df": "20", "icao24": "4ca001"}
    return [
        {"timestamp": row["timestamp"].timestamp(), "frame": "00" * 14, **fixed, "altitude": row["altitude"]}
        | {"bds60": {"IAS": row["IAS"], "Mach": row["Mach"], "vrate_barometric": row["vertical_rate"]}}
        for row in FLIGHT.iter_rows(named=True)
    ]


def blocks(category: int) -> bytes:
    content = b""
    for number, row in enumerate(FLIGHT.iter_rows(named=True)):
        level, speeds = row["altitude"] / 100, register_60(90.0, 270, row["Mach"], row["vertical_rate"])
        if category == 62:
            content += cat062("4ca001", 36_000 + 5 * number, level, 270, row["Mach"], row["vertical_rate"])
        else:
            content += cat048("4ca001", 36_000 + 5 * number, level, {0x60: speeds})
    return content


def lines(documents: list) -> bytes:
    return "\n".join(map(json.dumps, documents)).encode()


def unpadded(members: list[tuple[str, bytes]]) -> bytes:
    """An archive without the blocks of nothing that fill it up after its end."""
    whole = tar_of(members)
    used = len(whole.rstrip(b"\0"))
    return whole[: -(-used // 512) * 512 + 1024]


def table_of(frame: pl.DataFrame, kind: str) -> bytes:
    if kind == "parquet":
        return as_bytes(frame.write_parquet)
    if kind == "feather":
        return as_bytes(frame.write_ipc)
    if kind == "csv":
        return frame.write_csv().encode()
    rows = frame.with_columns(pl.col("timestamp").dt.epoch("ms")).to_dicts()
    if kind == "json-rows":
        return json.dumps(rows).encode()
    return json.dumps({name: {str(i): row[name] for i, row in enumerate(rows)} for name in rows[0]}).encode()


TABLES = ("parquet", "feather", "csv", "json-rows", "json-columns")
SOURCES: dict[str, bytes] = {
    **{kind: table_of(FLIGHT, kind) for kind in TABLES},
    "readsb-trace": json.dumps(trace_of(FLIGHT)).encode(),
    "aircraft-json": snapshots_of(FLIGHT),
    "scat": json.dumps(scat_of(flight().head(70))).encode(),
    "jet1090": lines(messages()),
    "modes-hex": "\n".join(f"{time} {frame}" for time, frame in frames()).encode(),
    "asterix-062": blocks(62),
    "asterix-048": blocks(48),
    "tar": unpadded([(f"./traces/0{n}/trace_full_4ca00{n}.json", packed(trace_of(FLIGHT))) for n in range(3)]),
}
OF_JSON = ("json-rows", "json-columns", "readsb-trace", "aircraft-json", "scat", "jet1090")


def outcome(path: Path, **options: object) -> tuple[pl.DataFrame | None, dict[str, int] | str]:
    """Rows and notes, or none and the message; anything but a DataError is a failure."""
    report = DropReport()
    try:
        return read_rows([path], report, **options), report.notes
    except DataError as error:
        words = str(error)
    assert "; expected " in words
    assert "; to mend it, " in words
    return None, words


def refused(path: Path, saying: str, **options: object) -> None:
    rows, words = outcome(path, **options)
    assert rows is None
    assert saying in words, words
