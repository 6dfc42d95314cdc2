"""The sampler and its decoder for onnxruntime (``.onnx``, opset 18), in Python, C++, JavaScript, C# or Java."""

import json
import logging
import warnings
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from importlib import resources
from pathlib import Path
from statistics import median
from time import perf_counter
from typing import Any

import torch
from torch import Tensor, nn
from torch.export import Dim, ExportedProgram

from descentflow.core.files import whole_file
from descentflow.core.tabular import optional_library
from descentflow.exports.descent_graph import SamplerGraph
from descentflow.exports.export_request import ExportRequest
from descentflow.exports.graph_description import decoder_inputs, describe

OPSET = 18
"""Version of the operators: what onnxruntime 1.14 and later run."""
DESCRIPTION = "descentflow"
"""Name of the description in a model's metadata."""
TRACED_WITH = 7
"""Descents of the example that is traced: more than one, or torch would take the batch to be one descent always."""
Run = Callable[[dict[str, Tensor]], Mapping[str, Tensor]]
BATCHES = (1, 100, 10_000)
"""Descents drawn at once."""
REPEATS, SECONDS = 20, 1.0
"""Calls whose median is the speed of a batch, fewer where they take longer than so many seconds."""
COMPARED = 200
"""Descents whose times are held against ours."""


def write(request: ExportRequest) -> list[Path]:
    """Write ``NAME.onnx``, its decoder ``NAME_decoder.onnx``, ``NAME.json`` and ``NAME.mjs``, which draws by them.

    Raises:
        ConfigError: If the density or the decoder cannot be exported, or a library of the extra is missing.

    Example:
        >>> from descentflow.densities.checkpoint import load_model
        >>> paths = write(ExportRequest(load_model("best.ckpt"), Path("a320.onnx"), precision="float32"))
        >>> [path.name for path in paths]
        ['a320.onnx', 'a320_decoder.onnx', 'a320.json', 'a320.mjs']
    """
    for library in ("onnx", "onnxscript"):
        optional_library(library, "onnx")
    runtime = None if request.report is None else optional_library("onnxruntime", "onnx")
    sampler = SamplerGraph(request.density, request.precision).eval()
    described = describe(request.density, sampler, request.precision)
    decoder = request.path.with_name(f"{request.path.stem}_decoder.onnx")
    models = {
        request.path: _converted(sampler, sampler.example_inputs(TRACED_WITH), described),
        decoder: _converted(sampler.descents, decoder_inputs(sampler, TRACED_WITH), described),
    }
    javascript = resources.files("descentflow.exports").joinpath("templates/descents.mjs").read_bytes()
    about = (json.dumps(described, indent=1) + "\n").encode()
    contents = {**models, request.beside(".json", about): about, request.beside(".mjs", javascript): javascript}
    for path, content in contents.items():
        with whole_file(path) as temporary:
            temporary.write_bytes(content)
    if request.report is not None:
        request.report(_figures(sampler, runtime, request.path))
    return list(contents)


def trace(module: nn.Module, inputs: dict[str, Tensor]) -> ExportedProgram:
    """Trace a module in evaluation mode, whose inputs all have the number of descents as first dimension.

    Args:
        module: In evaluation mode.
        inputs: An example of :data:`TRACED_WITH` descents, by argument.
    """
    batch = Dim("n")
    with _quiet_tracing(), torch.no_grad():
        return torch.export.export(module, (), inputs, dynamic_shapes={name: {0: batch} for name in inputs})


def to_onnx(program: ExportedProgram, names: tuple[list[str], list[str]], described: dict[str, Any]) -> bytes:
    """A traced module as a serialised model with named inputs and outputs.

    Args:
        program: From :func:`trace`.
        names: Of its inputs and of its outputs.
        described: Kept in the model's metadata.

    Example:
        >>> class Twice(nn.Module):
        ...     def forward(self, noise):
        ...         return {"twice": 2 * noise}
        >>> program = trace(Twice(), {"noise": torch.zeros(TRACED_WITH, 3)})
        >>> len(to_onnx(program, (["noise"], ["twice"]), {})) < 1000
        True
    """
    with _quiet_tracing():
        made = torch.onnx.export(
            program, opset_version=OPSET, dynamo=True, verbose=False, input_names=names[0], output_names=names[1]
        )
    assert made is not None
    graph = made.model.graph
    parts: list[Any] = [made.model, graph, *graph.all_nodes(), *graph.inputs, *graph.outputs]
    # What the converter notes of each part: how torch called it, and lines of source files on this machine.
    for part in (*parts, *graph.initializers.values()):
        part.metadata_props.clear()
    made.model.metadata_props[DESCRIPTION] = json.dumps(described)
    serialised: bytes = made.model_proto.SerializeToString()
    return serialised


def _converted(module: nn.Module, inputs: dict[str, Tensor], described: dict[str, Any]) -> bytes:
    with torch.no_grad():
        outputs = list(module(**inputs))
    return to_onnx(trace(module, inputs), (list(inputs), outputs), described)


@contextmanager
def _quiet_tracing() -> Iterator[None]:
    """Without the remarks that torch and its converter make on libraries and on their own deprecated parts."""
    loggers = [logging.getLogger(name) for name in ("torch.onnx", "torch.__trace", "onnx_ir", "onnxscript")]
    levels = [logger.level for logger in loggers]
    for logger in loggers:
        logger.setLevel(logging.ERROR)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            yield
    finally:
        for logger, level in zip(loggers, levels, strict=True):
            logger.setLevel(level)


def _figures(sampler: SamplerGraph, runtime: Any, path: Path) -> str:
    options = runtime.SessionOptions()
    options.intra_op_num_threads = torch.get_num_threads()
    session = runtime.InferenceSession(path, options, providers=["CPUExecutionProvider"])
    names = [output.name for output in session.get_outputs()]

    def run(inputs: dict[str, Tensor]) -> dict[str, Tensor]:
        found = session.run(None, {name: value.numpy() for name, value in inputs.items()})
        return {name: torch.from_numpy(value) for name, value in zip(names, found, strict=True)}

    threads = options.intra_op_num_threads
    return figures(sampler, run, path, f"onnxruntime {runtime.__version__}, {threads} thread{'s' * (threads > 1)}")


def figures(sampler: SamplerGraph, run: Run, path: Path, runtime: str) -> str:
    """One line: size of the file, time of a call for each size of batch, and the largest difference of the times.

    Args:
        sampler: What was exported.
        run: The exported sampler as it is read back.
        path: Its file.
        runtime: What runs it, for the line.

    Example:
        >>> from descentflow.densities.checkpoint import load_model
        >>> sampler = SamplerGraph(load_model("best.ckpt"))
        >>> print(figures(sampler, lambda inputs: sampler(**inputs), Path("best.ckpt"), "torch"))
        best.ckpt: ... kB; 1 descent in ... ms, 100 in ... ms, 10,000 in ... ms (torch); times within 0 s of ours
    """
    speeds = []
    for n in BATCHES:
        inputs = sampler.example_inputs(n)
        what = "1 descent" if n == 1 else f"{n:,}"
        milliseconds = 1000 * _seconds(run, inputs)
        speeds.append(f"{what} in {milliseconds:{'.0f' if milliseconds >= 100 else '.2g'}} ms")
    apart = difference_s(sampler, run)
    return f"{path.name}: {path.stat().st_size / 1000:.0f} kB; {', '.join(speeds)} ({runtime}); {_within(apart)}"


@torch.no_grad()
def difference_s(sampler: SamplerGraph, run: Run) -> float:
    """The largest difference of the times at any level, in seconds, of draws that are plausible.

    Example:
        >>> from descentflow.densities.checkpoint import load_model
        >>> sampler = SamplerGraph(load_model("best.ckpt"))
        >>> difference_s(sampler, lambda inputs: sampler(**inputs))
        0.0
    """
    inputs = sampler.example_inputs(COMPARED)
    ours, theirs = sampler(**inputs), run(inputs)
    apart = (ours["time_s"].double() - theirs["time_s"].double())[ours["accepted"]]
    return float(apart.nan_to_num().abs().max()) if len(apart) else float("nan")


def _within(apart: float) -> str:
    return "no draw of the comparison was plausible" if apart != apart else f"times within {apart:.1g} s of ours"


def _seconds(run: Run, inputs: dict[str, Tensor]) -> float:
    """Median wall-clock time of a call, after one that is not counted."""
    run(inputs)
    times: list[float] = []
    while len(times) < REPEATS and (not times or sum(times) < SECONDS):
        start = perf_counter()
        run(inputs)
        times.append(perf_counter() - start)
    return median(times)
