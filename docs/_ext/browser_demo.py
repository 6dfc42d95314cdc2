"""Files for the page on ONNX: a sampler exported here and now, and onnxruntime-web from npm."""

import shutil
import subprocess
import tarfile
import tempfile
from pathlib import Path
from typing import Any

from sphinx.application import Sphinx
from sphinx.util import logging

RUNTIME = "onnxruntime-web@1.30.0"
FILES = ("ort.wasm.bundle.min.mjs", "ort-wasm-simd-threaded.wasm")
"""Of the package's folder dist: 14 MB, loaded when the button is first pressed."""
FLIGHTS = 300
logger = logging.getLogger(__name__)


def export_sampler(folder: Path) -> None:
    """Export a mixture of the simulated world's A320, with single precision inputs and outputs."""
    import descentflow as df

    rows = df.simulate("A320", FLIGHTS, seed=11).rows
    model = df.fit(df.prepare(rows, typecode="A320"), model="mixture")
    df.export(model, "onnx", folder / "a320.onnx", precision="float32")


def fetch_runtime(folder: Path) -> None:
    """Take the two files of onnxruntime-web out of its npm package."""
    npm = shutil.which("npm")
    if npm is None:
        logger.info("no npm: the page on ONNX will say that its demonstration is left out")
        return
    with tempfile.TemporaryDirectory() as temporary:
        pack = [npm, "pack", "--silent", RUNTIME, "--pack-destination", temporary]
        subprocess.run(pack, check=True, capture_output=True, text=True, cwd=temporary)
        (archive,) = Path(temporary).glob("*.tgz")
        with tarfile.open(archive) as package:
            for name in FILES:
                content = package.extractfile(f"package/dist/{name}")
                assert content is not None
                (folder / name).write_bytes(content.read())


def place(app: Sphinx) -> Path:
    """Folder of the files, two below what `html_extra_path` names."""
    return Path(app.srcdir) / "made" / "site" / "browser"


def make(app: Sphinx) -> None:
    """Fill the folder, which the built site has as `browser`; what is there already is kept."""
    folder = place(app)
    if not (folder / "a320.onnx").is_file():
        export_sampler(folder)
    if not all((folder / name).is_file() for name in FILES):
        fetch_runtime(folder)


def setup(app: Sphinx) -> dict[str, Any]:
    """Tell Sphinx, which warns of extra folders that are not there yet when it reads its settings."""
    place(app).mkdir(parents=True, exist_ok=True)
    app.connect("builder-inited", make)
    return {"version": "1", "parallel_read_safe": True}
