"""Two runs into one target, and no home to keep anything in: a whole file, and nothing beside it."""

import os
import subprocess
import sys
from pathlib import Path

from surveillance_toys import fleet, written

NO_HOME = "/dev/null/home"
"""No folder can be made there, whoever asks."""


def begun(*words: str | Path, folder: Path) -> subprocess.Popen[str]:
    """The command, begun in a folder and with a home that cannot be written."""
    hidden = ("XDG_CACHE_HOME", "XDG_CONFIG_HOME", "MPLCONFIGDIR")
    environment = {name: value for name, value in os.environ.items() if name not in hidden} | {"HOME": NO_HOME}
    command = [sys.executable, "-m", "descentflow", *map(str, words)]
    return subprocess.Popen(command, cwd=folder, env=environment, stderr=subprocess.PIPE, text=True)


def test_two_runs_into_one_file_leave_what_one_leaves(tmp_path: Path) -> None:
    """The later one is refused while the first is at work; begun after it, it finds the file and writes it again."""
    rows = written(fleet(3), tmp_path / "rows.parquet")
    for number, folder in ((1, tmp_path / "alone"), (2, tmp_path / "together")):
        folder.mkdir()
        runs = [begun("prepare", rows, "--out", "d.parquet", "--quiet", folder=folder) for _ in range(number)]
        said = [run.communicate()[1] for run in runs]
        ended = [run.returncode for run in runs]
        assert 0 in ended, said
        assert all(not status or "another run is at work" in text for status, text in zip(ended, said, strict=True))
        assert [path.name for path in folder.iterdir()] == ["d.parquet"]
    alone, together = ((tmp_path / name / "d.parquet").read_bytes() for name in ("alone", "together"))
    assert alone == together
