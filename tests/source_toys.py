"""Files of made-up flights as each source writes them; frames and blocks are put together bit by bit."""

import gzip
import io
import json
import tarfile
from collections.abc import Iterable
from pathlib import Path

import polars as pl
from surveillance_toys import flight

from descentflow.surveillance.read_rows import read_rows
from descentflow.surveillance.rows.drop_report import DropReport
from descentflow.surveillance.rows.schema import POSSIBLE, REQUIRED

GENERATOR = 0x1FFF409
"""Of the parity of Mode S (ICAO Annex 10, volume IV, 3.1.2.3.3)."""
FLIGHT = flight()


def trace_of(flight: pl.DataFrame, *, details_every: int = 4, extended: bool = True) -> dict:
    """A trace as readsb writes it: details with every fourth point."""
    begin = flight["timestamp"][0].timestamp()
    points = []
    for number, row in enumerate(flight.iter_rows(named=True)):
        rate, altitude = round(row["vertical_rate"]), round(row["altitude"])
        details = {
            "type": "adsb_icao", "flight": f"{row['callsign']:<8}", "mach": round(row["Mach"], 3), "tas": 420,
            "mag_heading": 88.5, "baro_rate": rate, "oat": -40, "wd": 350, "ws": 20, "nav_altitude_mcp": 6000,
        }  # fmt: skip
        after_s = round(row["timestamp"].timestamp() - begin, 2)
        known = details if number % details_every == 0 else None
        point = [after_s, 52.0, 4.0, altitude, 400.5, row["track"], 0, rate, known]
        points.append(point + (["adsb_icao", altitude + 800, -16, round(row["IAS"]), -0.4] * extended))
    return {"icao": flight["icao24"][0], "r": "EI-TST", "t": flight["typecode"][0], "timestamp": begin, "trace": points}


def possible(rows: pl.DataFrame) -> pl.DataFrame:
    """Rows that have all that is required, within what is possible; the first of each time."""
    inside = [pl.col(name).is_between(*POSSIBLE[name]) for name in REQUIRED if name in POSSIBLE]
    return (
        rows.drop_nulls(list(REQUIRED)).filter(inside).unique(["icao24", "timestamp"], keep="first").sort("timestamp")
    )


def packed(document: object) -> bytes:
    return gzip.compress(json.dumps(document).encode())


def tar_of(members: Iterable[tuple[str, bytes]], *, form: int = tarfile.GNU_FORMAT) -> bytes:
    out = io.BytesIO()
    with tarfile.open(fileobj=out, mode="w", format=form) as archive:
        for name, content in members:
            info = tarfile.TarInfo(name)
            info.size = len(content)
            archive.addfile(info, io.BytesIO(content))
    return out.getvalue()


def snapshots_of(rows: pl.DataFrame) -> bytes:
    """One line a row, as dump1090-fa serves aircraft."""
    lines = []
    for row in rows.iter_rows(named=True):
        craft = {"hex": row["icao24"], "flight": row["callsign"], "t": row["typecode"], "alt_baro": row["altitude"]}
        craft |= {"ias": row["IAS"], "mach": row["Mach"], "baro_rate": row["vertical_rate"], "track": row["track"]}
        lines.append(json.dumps({"now": row["timestamp"].timestamp(), "aircraft": [craft]}))
    return "\n".join(lines).encode()


def scat_of(flight: pl.DataFrame) -> dict:
    """A flight of SCAT: level in hundreds of feet, velocity in m/s eastwards, one clearance with a speed."""
    plots = [
        {
            "time_of_track": row["timestamp"].strftime("%Y-%m-%dT%H:%M:%S.%f"),
            "I062/105": {"lat": 58.0, "lon": 16.0},
            "I062/136": {"measured_flight_level": row["altitude"] / 100},
            "I062/185": {"vx": 205.7776, "vy": 0.0},
            "I062/220": {"rocd": row["vertical_rate"]},
            "I062/380": {
                "subitem13": {"baro_vert_rate": row["vertical_rate"]},
                "subitem26": {"ias": row["IAS"]},
                "subitem27": {"mach": row["Mach"]},
                "subitem3": {"mag_hdg": 85.0},
                "subitem6": {"altitude": 11_000, "sas": False, "source": 0},
            },
        }
        for row in flight.iter_rows(named=True)
    ]
    times = flight["timestamp"]
    clearances = [
        {"time_stamp": time.strftime("%Y-%m-%dT%H:%M:%S.%f"), "cfl": level, "cfl_unit": unit}
        | {"assigned_speed_val": speed, "assigned_speed_unit": speed_unit}
        for time, level, unit, speed, speed_unit in (
            (times[0], 350, "F", None, None),
            (times[20], 190, "F", 0.77, "MACH"),
            (times[40], 4000, "A", 280.0, "KNOT"),
            (times[60], 4000, "A", None, None),
        )
    ]
    base = {"callsign": flight["callsign"][0], "aircraft_type": flight["typecode"][0], "adep": "EKCH", "ades": "ESSA"}
    return {"id": 7, "fpl": {"fpl_base": [base], "fpl_clearance": clearances}, "plots": plots}


def _crc(bits: int, length: int) -> int:
    for place in range(length - 24):
        if bits >> (length - 1 - place) & 1:
            bits ^= GENERATOR << (length - 25 - place)
    return bits & 0xFFFFFF


def _field(value: int, count: int) -> str:
    return format(value & ((1 << count) - 1), f"0{count}b")


def register_60(heading: float, ias: int, mach: float, rate_fpm: int) -> str:
    """The 56 bits of a heading and speed report (ICAO Doc 9871, table A-2-96), as hexadecimal digits."""
    turn = round((heading if heading < 180 else heading - 360) / (90 / 512))
    rate = round(rate_fpm / 32)
    bits = "1" + _field(turn, 11) + "1" + _field(ias, 10) + "1" + _field(round(mach / 0.004), 10)
    return f"{int(bits + ('1' + _field(rate, 10)) * 2, 2):014x}"


def register_50(roll: float, track: float, groundspeed: int, tas: int) -> str:
    """The 56 bits of a track and turn report (table A-2-80)."""
    turn = round((track if track < 180 else track - 360) / (90 / 512))
    bits = "1" + _field(round(roll / (45 / 256)), 10) + "1" + _field(turn, 11) + "1" + _field(groundspeed // 2, 10)
    return f"{int(bits + '1' + _field(0, 10) + '1' + _field(tas // 2, 10), 2):014x}"


def reply(icao24: str, altitude_ft: int, register: str) -> str:
    """A long altitude reply (downlink format 20): altitude in steps of 25 ft, register, parity over the address."""
    steps = (altitude_ft + 1000) // 25
    code = (
        (steps >> 5 & 0x3F) << 7 | (steps >> 4 & 1) << 5 | 1 << 4 | steps & 0xF
    )  # without the bits M and Q in between
    start = f"{20 << 27 | code:08x}{register}"
    return f"{start}{_crc(int(start + '000000', 16), 112) ^ int(icao24, 16):06x}"


def all_call(icao24: str) -> str:
    """An all-call reply (downlink format 11), which names an address beyond doubt."""
    start = f"{0x5D:02x}{icao24}"
    return f"{start}{_crc(int(start + '000000', 16), 56):06x}"


def _bytes(*values: tuple[float, int]) -> bytes:
    """Whole numbers of so many bytes, two's complement."""
    return b"".join((round(value) & ((1 << 8 * size) - 1)).to_bytes(size, "big") for value, size in values)


def _block(category: int, record: bytes) -> bytes:
    return _bytes((category, 1), (len(record) + 3, 2)) + record


def cat062(icao24: str, seconds: float, level_fl: float, ias: int, mach: float, rate_fpm: float) -> bytes:
    """A track of ASTERIX category 062 (EUROCONTROL-SPEC-0149-9, edition 1.18), item after item."""
    # 010 070 105 185 and more | 380 and more | 136 220
    presence = bytes([0b10011011, 0b00010001, 0b00100100])
    # address, magnetic heading, selected altitude and more | barometric rate and more | weather and more | IAS, Mach
    derived = bytes([0b10100101, 0b00000101, 0b00000101, 0b00001100])
    derived += bytes.fromhex(icao24) + _bytes((88.0 * 65536 / 360, 2), (1 << 15 | 2 << 13 | 11_000 // 25, 2))
    derived += _bytes((rate_fpm / 6.25, 2))
    derived += bytes([0b11100000]) + _bytes((35, 2), (270, 2), (-40 / 0.25, 2), (0, 1))
    derived += _bytes((ias, 2), (mach / 0.008, 2))
    degree = 2**25 / 180
    fixed = _bytes(
        (25, 1), (2, 1), (seconds * 128, 3), (45.5 * degree, 4), (8.25 * degree, 4), (205.75 / 0.25, 2), (0, 2)
    )
    return _block(62, presence + fixed + derived + _bytes((level_fl * 4, 2), (rate_fpm / 6.25, 2)))


def cat048(icao24: str, seconds: float, level_fl: float, registers: dict[int, str]) -> bytes:
    """A plot of category 048 (SPEC-0149-4, edition 1.21) with Mode S registers."""
    presence = bytes([0b11010101, 0b10100000])  # 010 140 040 090 and more | 220 250
    fixed = _bytes((25, 1), (2, 1), (seconds * 128, 3), (50 * 256, 2), (45 * 65536 / 360, 2), (level_fl * 4, 2))
    content = b"".join(bytes.fromhex(bits) + bytes([number]) for number, bits in registers.items())
    return _block(48, presence + fixed + bytes.fromhex(icao24) + bytes([len(registers)]) + content)


def written_to(path: Path, content: bytes | str) -> Path:
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    return path


def rows_of(path: Path, **options: object) -> tuple[pl.DataFrame, dict[str, int]]:
    """The rows that a file gives, and what was noted on the way."""
    report = DropReport()
    return read_rows([path], report, **options), report.notes


def assert_same_flight(read: pl.DataFrame, **tolerances: float) -> None:
    """Columns that all sources share are those of the flight, within a source's quantum."""
    assert len(read) == len(FLIGHT)
    for name in ("icao24", "typecode"):
        assert read[name].to_list() == FLIGHT[name].to_list()
    late = (read["timestamp"] - FLIGHT["timestamp"]).dt.total_microseconds().abs().max()
    assert late <= 1e6 * tolerances.pop("timestamp", 1e-6)
    for name, tolerance in {"altitude": 0.5, "vertical_rate": 0.5, "IAS": 1e-9, "Mach": 1e-9, **tolerances}.items():
        assert (read[name] - FLIGHT[name]).abs().max() <= tolerance, name
