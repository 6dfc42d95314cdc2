"""The sampler and its decoder for onnxruntime (``.onnx``, opset 18), in Python, C++, JavaScript, C# or Java."""

import json
import logging
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from importlib import resources
from pathlib import Path
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
