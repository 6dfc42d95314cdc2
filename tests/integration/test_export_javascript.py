"""The exported sampler flown from JavaScript by node, as the page of the documentation does."""

import json
import shutil
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.stats import ks_2samp

import descentflow as df

ort = pytest.importorskip("onnxruntime", reason="onnxruntime is in the extra onnx of descentflow")

DOCS = Path(__file__).parents[2] / "docs"
RUNTIME = ("ort.wasm.bundle.min.mjs", "ort-wasm-simd-threaded.wasm")
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
    feeds["neighbour"] = rng.random(20, dtype=np.float32)
    listed = {name: {"data": value.ravel().tolist(), "dims": value.shape} for name, value in feeds.items()}
    (folder / "feeds.json").write_text(json.dumps(listed))
    (folder / "draw.mjs").write_text(BY_NODE.replace("COUNT", str(N)))
    done = subprocess.run([node, "draw.mjs"], cwd=folder, capture_output=True, text=True, check=True)
    return json.loads(done.stdout), feeds


def test_node_gives_the_numbers_of_python(folder: Path, by_node: tuple[dict[str, Any], dict[str, np.ndarray]]) -> None:
    said, feeds = by_node
    expected = ort.InferenceSession(folder / "a320.onnx").run(["time_s", "accepted"], feeds)
    time_s = np.array([np.nan if v is None else v for v in said["time_s"]]).reshape(expected[0].shape)
    np.testing.assert_allclose(time_s, expected[0], rtol=0, atol=1e-4)
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
