"""The exported sampler flown from JavaScript: by node, and by the page of the documentation in a real browser."""

import functools
import json
import re
import shutil
import subprocess
import threading
from collections.abc import Iterator
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import pytest
from scipy.stats import ks_2samp

import descentflow as df

ort = pytest.importorskip("onnxruntime", reason="onnxruntime is in the extra onnx of descentflow")

DOCS = Path(__file__).parents[2] / "docs"
RUNTIME = ("ort.wasm.bundle.min.mjs", "ort-wasm-simd-threaded.wasm")
LONGEST_S = 240
"""Until a browser that has not answered has failed."""
N = 1500


@pytest.fixture(scope="module")
def runtime() -> Path:
    """Folder of onnxruntime-web."""
    made = DOCS / "made" / "site" / "browser"
    if not all((made / name).is_file() for name in RUNTIME):
        pytest.skip("onnxruntime-web is not here: scripts/docs takes it from npm into docs/made/site/browser")
    return made


@pytest.fixture(scope="module")
def folder(runtime: Path, sampler: tuple[Path, str], tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A sampler beside onnxruntime-web, as the documentation's site has both."""
    place = tmp_path_factory.mktemp("site") / "browser"
    place.mkdir()
    for name in RUNTIME:
        shutil.copy(runtime / name, place)
    for suffix in (".onnx", ".json", ".mjs"):
        shutil.copy(sampler[0].with_suffix(suffix), place)
    return place


BY_NODE = """
import fs from "node:fs";
import * as ort from "./ort.wasm.bundle.min.mjs";
import { Descents } from "./a320.mjs";
ort.env.wasm.numThreads = 1;
ort.env.wasm.wasmBinary = fs.readFileSync("ort-wasm-simd-threaded.wasm");
const about = JSON.parse(fs.readFileSync("a320.json"));
const session = await ort.InferenceSession.create(fs.readFileSync("a320.onnx"));
const drawn = [];
for (const seed of [7, 7, 8]) drawn.push(await new Descents(ort, session, about, seed).draw(3));
const many = await new Descents(ort, session, about, 0).draw(COUNT, { entry_fl: 330 });
const given = JSON.parse(fs.readFileSync("feeds.json"));
const feeds = Object.fromEntries(Object.entries(given).map(([name, { data, dims }]) =>
  [name, new ort.Tensor("float32", Float32Array.from(data), dims)]));
const { time_s, accepted } = await session.run(feeds);
console.log(JSON.stringify({
  seeds: drawn.map((one) => one.samples),
  minutes: many.samples.map((one) => one.time_s.at(-1) / 60),
  levels: [Math.max(...many.samples.map((one) => one.level_fl[0])), many.samples[0].level_fl.at(-1)],
  time_s: Array.from(time_s.data, (v) => (Number.isNaN(v) ? null : v)), accepted: Array.from(accepted.data),
}));
"""


@pytest.fixture(scope="module")
def by_node(folder: Path) -> tuple[dict[str, Any], dict[str, np.ndarray]]:
    """Output of node, and the numbers that it was given."""
    node = shutil.which("node")
    if node is None:
        pytest.skip("node is not on this machine")
    about = json.loads((folder / "a320.json").read_text())
    rng = np.random.default_rng(1)
    feeds = {
        name: rng.standard_normal([20 if size == "n" else size for size in what["shape"]]).astype(np.float32)
        for name, what in about["inputs"]["sampler"].items()
    }
    feeds["entry_fl"] = np.full(20, 330, np.float32)
    listed = {name: {"data": value.ravel().tolist(), "dims": value.shape} for name, value in feeds.items()}
    (folder / "feeds.json").write_text(json.dumps(listed))
    (folder / "draw.mjs").write_text(BY_NODE.replace("COUNT", str(N)))
    done = subprocess.run([node, "draw.mjs"], cwd=folder, capture_output=True, text=True, check=True)
    return json.loads(done.stdout), feeds


def test_node_gives_the_numbers_of_python(folder: Path, by_node: tuple[dict[str, Any], dict[str, np.ndarray]]) -> None:
    said, feeds = by_node
    expected = ort.InferenceSession(folder / "a320.onnx").run(["time_s", "accepted"], feeds)
    found = np.array([np.nan if v is None else v for v in said["time_s"]]).reshape(expected[0].shape)
    np.testing.assert_allclose(found, expected[0], rtol=0, atol=1e-4)
    assert np.array_equal(np.array(said["accepted"], bool), expected[1])


def test_node_draws_our_descents_and_a_seed_repeats_them(
    a320: Path, by_node: tuple[dict[str, Any], dict[str, np.ndarray]]
) -> None:
    """Two samples of one distribution; Kolmogorov-Smirnov p < 1e-4 fails one right sampler in 10,000."""
    said, _ = by_node
    first, again, other = said["seeds"]
    assert first == again
    assert first[0]["time_s"] != other[0]["time_s"]
    assert said["levels"] == [330, 150]
    assert len(said["minutes"]) == N
    ours = df.sample(a320, N, seed=3, entry_fl=330).trajectories.time_s[:, 0].numpy() / 60
    assert ks_2samp(said["minutes"], ours).pvalue > 1e-4


class Answer(SimpleHTTPRequestHandler):
    """Serves files, and keeps what a page posts."""

    posted: ClassVar[dict[str, Any]]
    arrived: ClassVar[threading.Event]

    def do_POST(self) -> None:
        length = int(self.headers["Content-Length"])
        type(self).posted = json.loads(self.rfile.read(length))
        self.send_response(204)
        self.end_headers()
        type(self).arrived.set()

    def log_message(self, *args: object) -> None:
        """Quietly."""


@pytest.fixture
def server(folder: Path) -> Iterator[tuple[str, type[Answer]]]:
    class Own(Answer):
        posted: ClassVar[dict[str, Any]] = {}
        arrived = threading.Event()
        extensions_map: ClassVar[dict[str, str]] = {
            **SimpleHTTPRequestHandler.extensions_map,
            ".mjs": "text/javascript",
        }

    handler = functools.partial(Own, directory=str(folder.parent))
    with ThreadingHTTPServer(("127.0.0.1", 0), handler) as listening:
        thread = threading.Thread(target=listening.serve_forever)
        thread.start()
        yield f"http://127.0.0.1:{listening.server_port}", Own
        listening.shutdown()
        thread.join()


CLICK = """
<script type="module">
const root = document.getElementById("draw-descents");
root.querySelector('[data-part="number"]').value = "50";
root.querySelector('[data-part="entry"]').value = "330";
root.querySelector('[data-part="draw"]').click();
const wait = () => {
  if (!root.dataset.drawn && !root.dataset.failed) return setTimeout(wait, 50);
  fetch("/answer", { method: "POST", body: JSON.stringify({
    ...root.dataset,
    said: root.querySelector('[data-part="said"]').textContent,
    lines: root.querySelectorAll("polyline").length,
    loaded: performance.getEntriesByType("resource").map((entry) => entry.name),
  }) });
};
wait();
</script>
"""


def test_a_click_draws_descents_in_a_browser(folder: Path, server: tuple[str, type[Answer]], tmp_path: Path) -> None:
    browser = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
    if browser is None:
        pytest.skip("no chromium is on this machine")
    fragment = re.search(r"```\{raw\} html\n(.*?)```", (DOCS / "how-to" / "export_onnx.md").read_text(), re.DOTALL)
    assert fragment is not None
    for name in ("how-to", "_static"):
        (folder.parent / name).mkdir(exist_ok=True)
    shutil.copy(DOCS / "_static" / "draw_descents.mjs", folder.parent / "_static")
    (folder.parent / "how-to" / "page.html").write_text(f"<!doctype html>{fragment[1]}{CLICK}")
    address, answer = server
    settings = ["--headless", "--no-sandbox", "--disable-gpu", "--remote-debugging-port=0"]
    running = subprocess.Popen(
        [browser, *settings, f"--user-data-dir={tmp_path}", f"{address}/how-to/page.html"],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    try:
        assert answer.arrived.wait(LONGEST_S), "the page has not answered"
    finally:
        running.kill()
        running.wait()
    found = answer.posted
    assert "failed" not in found, found
    assert found["drawn"] == "50"
    assert found["lines"] == 50
    assert re.match(
        r"50 descents of \d+ draws in \d+ ms, in this browser; median to FL150: 1?\d\.\d min", found["said"]
    )
    assert len(found["loaded"]) >= 6
    assert [name for name in found["loaded"] if not name.startswith(address)] == [], "nothing is loaded from elsewhere"
