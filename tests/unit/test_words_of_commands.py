"""Words of a command line whose bytes Python could not read as letters."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from descentflow.cli.entry import main
from descentflow.core.errors import ConfigError
from descentflow.surveillance.prepare import prepare


def test_letters_that_the_locale_lacks_ask_for_another_locale() -> None:
    """A process in the plain C locale: the file has its right name, so renaming it would be no help."""
    bare = {"LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"}
    words = [sys.executable, "-W", "ignore", "-m", "descentflow", "info", "é.ckpt".encode()]
    done = subprocess.run(words, capture_output=True, check=False, env={**os.environ, **bare})
    assert done.returncode == 2
    assert b"PYTHONUTF8=1 if the locale lacks such letters" in done.stderr


def test_bytes_that_are_no_letters_ask_for_another_name(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["info", os.fsdecode(b"\xff.ckpt")]) == 2
    assert "rename the file" in capsys.readouterr().err


def test_a_folder_with_such_a_name_is_refused(tmp_path: Path) -> None:
    try:
        (tmp_path / os.fsdecode(b"h\xf6he.csv")).write_text("timestamp,icao24,altitude,IAS,Mach\n")
    except OSError:
        pytest.skip("this file system takes names in UTF-8 only")
    with pytest.raises(ConfigError, match=r"h\\udcf6he.csv'; expected words and names of files in UTF-8"):
        prepare(tmp_path)
