"""A fit from the command line for the tests of what it leaves behind; each test file has its own."""

from pathlib import Path

import pytest
import toys
from command_line_toys import fit


@pytest.fixture(scope="module")
def descents(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return toys.write_descents_file(tmp_path_factory.mktemp("data") / "a320.parquet", 300)


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory, descents: Path) -> Path:
    return fit(tmp_path_factory.mktemp("gaussian"), descents, "gaussian")
