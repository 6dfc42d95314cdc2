"""A fit from the command line for the tests of what it leaves behind; each test file has its own."""

import io
import warnings
from contextlib import redirect_stdout
from pathlib import Path

import pytest
import toys
from command_line_toys import fit
from kept_by_workers import folder_of_workers, once

import descentflow as df
from descentflow.cli.entry import main


@pytest.fixture(scope="module")
def descents(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return toys.write_descents_file(tmp_path_factory.mktemp("data") / "a320.parquet", 300)


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory, descents: Path) -> Path:
    return fit(tmp_path_factory.mktemp("gaussian"), descents, "gaussian")


@pytest.fixture(scope="session")
def a320(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A checkpoint of 250 A320 of the simulated world, for what other programs make of its samples."""
    folder = folder_of_workers(tmp_path_factory, "a320")

    def fitted() -> Path:
        descents = df.prepare(df.simulate("A320", 250, seed=11).rows, typecode="A320")
        df.fit(descents, model="gaussian", out=folder / "a320.ckpt")
        return folder / "a320.ckpt"

    return once(folder, "path", fitted)


@pytest.fixture(scope="session")
def sampler(a320: Path, tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, str]:
    """The A320's sampler as the command writes it for onnxruntime, in single precision, and what it printed."""
    for library in ("onnxruntime", "onnxscript"):
        pytest.importorskip(library, reason=f"{library} is in the extra onnx of descentflow")
    folder = folder_of_workers(tmp_path_factory, "sampler")
    path = folder / "a320.onnx"

    def exported() -> str:
        words = ["export", str(a320), "--to", "onnx", "--out", str(path), "--precision", "float32"]
        with redirect_stdout(io.StringIO()) as said, warnings.catch_warnings():
            warnings.simplefilter("ignore")  # the exporter's own
            assert main(words) == 0
        return said.getvalue()

    return path, once(folder, "said", exported)
