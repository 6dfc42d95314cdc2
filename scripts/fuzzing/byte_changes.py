"""Damage to bytes: what a bad disk, a broken connection or an editor does, and archives that were made to harm."""

import gzip
import io
import pickle
import random
import re
import tarfile
import zipfile
from collections.abc import Callable
from pathlib import Path

from fuzzing.values import NUMBERS, TEXTS, TIMES

NUMBER = re.compile(rb"-?\d+(?:\.\d+)?(?:[eE][-+]?\d+)?")
BOMB_BYTES = 1 << 28
BOMB_MEMBERS = 300
"""Members of gzip, each a megabyte of line ends: 300 MB that a few hundred kilobytes unpack to."""


def damaged(content: bytes, rng: random.Random) -> bytes:
    """One to four changes of bytes, one after the other."""
    for _ in range(rng.choice((1, 1, 1, 2, 4))):
        content = rng.choice(CHANGES)(content, rng)
    return content


def wrapped(content: bytes, name: str, rng: random.Random) -> tuple[bytes, str]:
    """The content in an archive that is right, cut short, nested, a bomb, or leads out of its folder."""
    return rng.choice(ARCHIVES)(content, name, rng)


def _place(content: bytes, rng: random.Random) -> tuple[int, int]:
    """Begin and end of a slice of up to a tenth of the content."""
    start = rng.randrange(len(content) + 1)
    return start, min(len(content), start + rng.randrange(1, max(len(content) // 10, 2)))


def _flipped(content: bytes, rng: random.Random) -> bytes:
    if not content:
        return content
    changed = bytearray(content)
    for _ in range(rng.choice((1, 1, 8, 64))):
        changed[rng.randrange(len(changed))] ^= 1 << rng.randrange(8)
    return bytes(changed)


def _cut_short(content: bytes, rng: random.Random) -> bytes:
    return content[: rng.randrange(len(content) + 1)]


def _cut_out(content: bytes, rng: random.Random) -> bytes:
    start, end = _place(content, rng)
    return content[:start] + content[end:]


def _repeated(content: bytes, rng: random.Random) -> bytes:
    start, end = _place(content, rng)
    return content[:end] + content[start:end] * rng.choice((1, 2, 50)) + content[end:]


def _overwritten(content: bytes, rng: random.Random) -> bytes:
    start, end = _place(content, rng)
    size = end - start
    filling = rng.choice((b"\0" * size, b"\xff" * size, b"\n" * size, rng.randbytes(size)))
    return content[:start] + filling + content[end:]


def _inserted(content: bytes, rng: random.Random) -> bytes:
    start, _ = _place(content, rng)
    what = rng.choice((b"\0", b"\n", b"\r\n", b'"', b",", b"[", b"{", b"\xef\xbb\xbf", b"\xff\xfe", rng.randbytes(40)))
    return content[:start] + what * rng.choice((1, 1, 100)) + content[start:]


def _another_number(content: bytes, rng: random.Random) -> bytes:
    """One number of a text, or each alike, is another."""
    numbers = list(NUMBER.finditer(content))
    if not numbers:
        return _flipped(content, rng)
    new = str(rng.choice((*NUMBERS, *TEXTS, *(f'"{time}"' for time in TIMES), "[]", "{}", "9" * 5000))).encode()
    if rng.random() < 0.2:
        old = rng.choice(numbers).group()
        return content.replace(old, new)
    place = rng.choice(numbers)
    return content[: place.start()] + new + content[place.end() :]


def _swapped(content: bytes, rng: random.Random) -> bytes:
    start, end = _place(content, rng)
    return content[end:] + content[start:end] + content[:start]


CHANGES: tuple[Callable[[bytes, random.Random], bytes], ...] = (
    _flipped,
    _flipped,
    _cut_short,
    _cut_out,
    _repeated,
    _overwritten,
    _inserted,
    _another_number,
    _another_number,
    _swapped,
    lambda content, rng: b"",
    lambda content, rng: content * 2,
)


def _gz(content: bytes, name: str, rng: random.Random) -> tuple[bytes, str]:
    packed = gzip.compress(content)
    return (packed if rng.random() < 0.3 else damaged(packed, rng)), f"{name}.gz"


def _zip(content: bytes, name: str, rng: random.Random) -> tuple[bytes, str]:
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w", zipfile.ZIP_DEFLATED) as archive:
        for number in range(rng.choice((1, 3))):
            archive.writestr(
                rng.choice((f"{number}-{name}", f"../{name}", f"/{name}", "x", "a/" * 200 + name)), content
            )
    return (out.getvalue() if rng.random() < 0.5 else damaged(out.getvalue(), rng)), "rows.zip"


def _tar(content: bytes, name: str, rng: random.Random) -> tuple[bytes, str]:
    out = io.BytesIO()
    with tarfile.open(fileobj=out, mode="w") as archive:
        for kind in rng.choices(
            (tarfile.REGTYPE, tarfile.SYMTYPE, tarfile.LNKTYPE, tarfile.FIFOTYPE), (6, 1, 1, 1), k=3
        ):
            member = tarfile.TarInfo(rng.choice((name, f"../{name}", f"/{name}", "x" * 300)))
            member.type, member.linkname = kind, "/etc/passwd"
            member.size = len(content) if kind == tarfile.REGTYPE else 0
            archive.addfile(member, io.BytesIO(content) if member.size else None)
    return (out.getvalue() if rng.random() < 0.5 else damaged(out.getvalue(), rng)), "rows.tar"


def _nested(content: bytes, name: str, rng: random.Random) -> tuple[bytes, str]:
    for _ in range(rng.choice((2, 5, 20))):
        content, name = rng.choice((_gz, _zip, _tar))(content, name[-60:], rng)
    return content, name


def _bomb(content: bytes, name: str, rng: random.Random) -> tuple[bytes, str]:
    filling = rng.choice((b"\n", b" ", b"\0", b"[", b"1,"))
    member = gzip.compress(filling * (1 << 20), 9)
    return gzip.compress(content) + member * rng.choice((3, BOMB_MEMBERS)), f"{name}.gz"


class _Runs:
    """Object of a pickle that runs code where it is opened."""

    def __init__(self, made: Path) -> None:
        self.made = made

    def __reduce__(self) -> tuple[Callable[[str], object], tuple[str]]:
        return exec, (f"open({str(self.made)!r}, 'w').close()",)


def running_code(checkpoint: bytes, made: Path, rng: random.Random) -> bytes:
    """A checkpoint whose pickle runs code, or unpacks to a gigabyte, or whose members lead out of it.

    Args:
        checkpoint: A whole one.
        made: File that its code makes.
        rng: What chooses.
    """
    kind = rng.choice(("pickle", "member", "bomb", "names"))
    if kind == "pickle":
        return pickle.dumps(_Runs(made), protocol=rng.choice((2, 4)))
    out = io.BytesIO()
    with (
        zipfile.ZipFile(io.BytesIO(checkpoint)) as whole,
        # torch compresses none: a compressed one is refused before its pickle is looked at.
        zipfile.ZipFile(out, "w", zipfile.ZIP_DEFLATED if kind == "bomb" else zipfile.ZIP_STORED) as archive,
    ):
        for name in whole.namelist():
            content = whole.read(name)
            if name.endswith("data.pkl") and kind == "member":
                content = pickle.dumps(_Runs(made), protocol=2)
            elif name.endswith("data.pkl") and kind == "bomb":
                content += b"\0" * BOMB_BYTES
            archive.writestr(f"../{name}" if kind == "names" else name, content)
    return out.getvalue()


ARCHIVES = (_gz, _gz, _zip, _zip, _tar, _tar, _nested, _bomb)
