"""The exported sampler gives our descents in onnxruntime, in either precision, for each density."""

import json
from pathlib import Path

import numpy as np
import pytest
import torch
from graph_toys import PARTS, density, table_of, weights_of
from torch import Tensor
from torch.export import ExportedProgram

from descentflow.densities.density import Density
from descentflow.densities.weight_draws import MixtureDraw
from descentflow.exports.descent_graph import OFF_GRID, PROFILES, Precision, SamplerGraph
from descentflow.exports.onnx_export import TRACED_WITH, to_onnx, trace
from descentflow.representation.plausibility import RULES

ort = pytest.importorskip("onnxruntime", reason="onnxruntime is in the extra onnx of descentflow")
pytest.importorskip("onnxscript", reason="onnxscript is in the extra onnx of descentflow")
pytestmark = pytest.mark.filterwarnings("ignore::FutureWarning", "ignore::DeprecationWarning")

N = 60
OUTPUTS = ["level_fl", *PROFILES, "accepted", "broken", "weights"]
OURS = {"float64": 1e-9, "float32": 1e-4}
"""Largest difference of times, in seconds. In single precision a time below 2,048 s is rounded by up to 6e-5 s."""


def by_onnx(program: ExportedProgram, inputs: dict[str, Tensor]) -> dict[str, Tensor]:
    session = ort.InferenceSession(to_onnx(program, (list(inputs), OUTPUTS), {}))
    assert [one.name for one in session.get_inputs()] == list(inputs)
    outputs = session.run(None, {name: value.numpy() for name, value in inputs.items()})
    alone = session.run(None, {name: value[:1].numpy() for name, value in inputs.items()})
    first, one = (torch.from_numpy(values[OUTPUTS.index("time_s")]) for values in (outputs, alone))
    torch.testing.assert_close(one, first[:1], rtol=1e-7, atol=1e-9, equal_nan=True)
    return {name: torch.from_numpy(value) for name, value in zip(OUTPUTS, outputs, strict=True)}


def ours(model: Density, sampler: SamplerGraph, inputs: dict[str, Tensor]) -> tuple[dict[str, Tensor], Tensor]:
    """Inputs with noise of a seed, and our table and weights of the same numbers."""
    entry = sampler.descents.entry(inputs["entry_fl"])
    component = None
    if sampler.draw.picks:
        assert isinstance(sampler.draw, MixtureDraw)
        component = sampler.draw.component(inputs["uniform"])
    noise, weights = weights_of(model, 5, len(entry), component)
    inputs["noise"] = noise.to(inputs["noise"])
    residual = PARTS.decoder.residuals.draw(weights, entry, inputs["neighbour"])
    return table_of(PARTS, weights, entry, residual), weights


OTHERS = [
    ("gaussian", "float64"), ("mixture", "float64"), ("whitened flow", "float64"),
    ("gaussian", "float32"), ("whitened flow", "float32"),
]  # fmt: skip


@pytest.mark.parametrize(
    ("kind", "precision"), [("mixture", "float32"), *(pytest.param(*one, marks=pytest.mark.slow) for one in OTHERS)]
)
def test_the_sampler_gives_our_descents(kind: str, precision: Precision) -> None:
    """In onnxruntime, of the same random numbers."""
    model = density(kind, PARTS)
    # The flow's own arithmetic is float32; its exact draws are those of its float64 copy.
    model = model.double() if precision == "float64" else model
    sampler = SamplerGraph(model, precision).eval()
    inputs = sampler.example_inputs(N)
    expected, weights = ours(model, sampler, inputs)
    program = trace(sampler, sampler.example_inputs(TRACED_WITH))
    double = precision == "float64"
    outputs = by_onnx(program, inputs)
    torch.testing.assert_close(outputs["weights"].double(), weights, rtol=0, atol=1e-12 if double else 2e-6)
    good = outputs["accepted"]
    assert float(good.double().mean()) > 0.2
    assert kind == "gaussian" or not bool(good.all()), "draws of both kinds are compared"
    for name in PROFILES:
        # Drag is tens of thousands of N, rates are thousands of ft/min, CO2 is thousands of kg.
        within = {"drag_n": 100, "thrust_n": 100, "vertical_rate": 10, "co2_kg": 10}.get(name, 1) * OURS[precision]
        mine = expected[name][good]
        torch.testing.assert_close(outputs[name][good].double(), mine, rtol=0, atol=within, equal_nan=True)
    assert torch.equal(outputs["broken"][:, : len(RULES)], expected["broken"])
    assert torch.equal(good, ~expected["broken"].any(1))
    assert torch.equal(outputs["level_fl"].double(), PARTS.decoder.levels_fl)


def test_decoder_and_sampler_give_the_same_and_say_what_they_take(sampler: tuple[Path, str]) -> None:
    path, _ = sampler
    about = json.loads(path.with_suffix(".json").read_text())
    draws, decoder = (ort.InferenceSession(p) for p in (path, path.with_name("a320_decoder.onnx")))
    generator = np.random.default_rng(0)
    feeds = {
        name: generator.standard_normal([5 if size == "n" else size for size in what["shape"]]).astype(np.float32)
        for name, what in about["inputs"]["sampler"].items()
    }
    feeds["entry_fl"] = np.array([330, 340, 350, 2000, np.nan], np.float32)
    drawn = dict(zip(about["outputs"], draws.run(list(about["outputs"]), feeds), strict=True))
    assert {name: list(v.shape) for name, v in drawn.items()} == {
        name: [5 if size == "n" else size for size in what["shape"]] for name, what in about["outputs"].items()
    }
    taken = {name: drawn.get(name, feeds.get(name)) for name in about["inputs"]["decoder"]}
    names = [name for name in about["outputs"] if name != "weights"]
    for name, again in zip(names, decoder.run(names, taken), strict=True):
        # The weights between both are rounded to single precision: some 1e-7 of a minute.
        np.testing.assert_allclose(again, drawn[name], rtol=1e-5, atol=1e-3, err_msg=name)
    assert not drawn["accepted"][3:].any(), "levels that the model does not have"
    assert drawn["broken"][3:, about["rules"].index(OFF_GRID)].all()
    assert np.isnan(drawn["time_s"][0, drawn["level_fl"] > 330]).all()
    assert json.loads(draws.get_modelmeta().custom_metadata_map["descentflow"]) == about


@pytest.mark.parametrize("name", ["a320.onnx", "a320_decoder.onnx", "a320.json"])
def test_nothing_of_this_machine_is_written(sampler: tuple[Path, str], name: str) -> None:
    content = sampler[0].with_name(name).read_bytes()
    assert b".py" not in content
    assert str(Path(__file__).parents[2]).encode() not in content
