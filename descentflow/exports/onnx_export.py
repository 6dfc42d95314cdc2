"""The sampler and its decoder for onnxruntime (``.onnx``, opset 18), in Python, C++, JavaScript, C# or Java.

Its description for users has inputs, outputs, units, bounds, and the draw of entry levels.
"""

import json
import logging
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict
from importlib import resources
from pathlib import Path
from typing import Any

import torch
from torch import Tensor, nn
from torch.export import Dim, ExportedProgram

from descentflow.core.files import write_whole
from descentflow.core.tabular import optional_library
from descentflow.core.version import __version__
from descentflow.densities.density import Density
from descentflow.exports.descent_graph import ALL_RULES, PROFILES, Precision, SamplerGraph
from descentflow.exports.export_request import ExportRequest
from descentflow.generation.sample_columns import COLUMNS, FUEL
from descentflow.representation.context import ContextColumn

FORMAT = "descentflow-sampler"
VERSION = 1
INPUTS = {
    "noise": "independent standard normals, from which the weights are made",
    "weights": "standardised weights of drag, then of CAS",
    "entry_fl": "flight level where the descent starts; the nearest level of the grid is taken",
    "neighbour": "a uniform number in [0, 1), which picks the training flight whose residual is taken",
    "uniform": "a uniform number in [0, 1), which picks the component of the mixture",
    "context": "the numbers that stand for the flight's context, see `context`",
}
"""Meaning of each input."""
BOUNDS = {"drag_n": ("drag_low", "drag_high"), "cas_mps": ("cas_low", "cas_high")}
"""Bound of the description -> buffers of :class:`~descentflow.representation.plausibility.Plausibility`."""
LIMITS = ("slowest_rate_mps", "fastest_change_mps2", "fastest_rate_change_mps2")
"""Bounds that are a buffer of the same name."""


def describe(density: Density, sampler: SamplerGraph, precision: Precision) -> dict[str, Any]:
    """The description of a sampler and its decoder, as primitives for a JSON document.

    Args:
        density: The model.
        sampler: Its exported modules.
        precision: Of inputs and outputs.

    Example:
        >>> from descentflow.densities.checkpoint import load_model
        >>> model = load_model("best.ckpt")
        >>> made = describe(model, SamplerGraph(model), "float64")
        >>> made["inputs"]["sampler"]["noise"]["shape"], made["outputs"]["CAS"]["unit"], made["redraw"]
        (['n', 4], 'knot', 'noise, with the same entry_fl')
    """
    representation = density.representation
    levels_fl = representation.decoder.levels_fl
    counts = representation.plausibility.entry_counts.cpu().double()
    described: dict[str, Any] = {
        "format": FORMAT,
        "version": VERSION,
        "made_by": f"descentflow {__version__}",
        "typecode": representation.decoder.aircraft.typecode,
        "density": type(density).__name__,
        "precision": precision,
        "levels_fl": _numbers(levels_fl),
        "inputs": {
            "sampler": _inputs(sampler.example_inputs(1), precision),
            "decoder": _inputs(decoder_inputs(sampler, 1), precision),
        },
        "outputs": _outputs(sampler, precision),
        "rules": list(ALL_RULES),
        "bounds": {
            **{
                name: [_numbers(getattr(representation.plausibility, end)) for end in ends]
                for name, ends in BOUNDS.items()
            },
            **{name: _numbers(getattr(representation.plausibility, name)) for name in LIMITS},
        },
        "entry_share": _numbers(counts / counts.sum()),
        "redraw": sampler.draw.redraw,
    }
    if representation.n_context:
        described["context"] = [_context(column) for column in representation.context.columns]
    return described


def decoder_inputs(sampler: SamplerGraph, n: int) -> dict[str, Tensor]:
    """Inputs of the decoder for the descents of ``SamplerGraph.example_inputs``, weights in place of noise.

    Example:
        >>> from descentflow.densities.checkpoint import load_model
        >>> list(decoder_inputs(SamplerGraph(load_model("best.ckpt")), 3))
        ['weights', 'entry_fl', 'neighbour']
    """
    inputs = sampler.example_inputs(n)
    weights = sampler(**inputs)["weights"].detach()
    return {"weights": weights, **{name: inputs[name] for name in ("entry_fl", "neighbour") if name in inputs}}


def _inputs(example: dict[str, Tensor], precision: Precision) -> dict[str, Any]:
    return {name: _about(["n", *value.shape[1:]], precision, INPUTS[name]) for name, value in example.items()}


def _about(shape: list[Any], kind: str, meaning: str, **unit: str) -> dict[str, Any]:
    return {"shape": shape, "type": kind, **unit, "meaning": meaning}


IN_AIR = ("TAS", *FUEL, "distance_nm")
"""Outputs that the temperature of the air would change."""


def _outputs(sampler: SamplerGraph, precision: Precision) -> dict[str, Any]:
    n_levels = len(sampler.descents.decoder.levels_fl)
    air = ", in standard air whatever the temperature of the context" if sampler.n_context else ""
    profiles = {name: f"{COLUMNS[name].meaning}{air if name in IN_AIR else ''}" for name in PROFILES}
    return {
        "level_fl": _about([n_levels], precision, "flight levels, ascending", unit=COLUMNS["level_fl"].udunit),
        **{
            name: _about(["n", n_levels], precision, f"{meaning}; NaN above the entry level", unit=COLUMNS[name].udunit)
            for name, meaning in profiles.items()
        },
        "accepted": _about(["n"], "bool", "whether the draw keeps every rule; drop it if not"),
        "broken": _about(["n", len(ALL_RULES)], "bool", "which of `rules` the draw breaks"),
        "weights": _about(["n", sampler.dimension], precision, "standardised weights; an output of the sampler alone"),
    }


def _context(column: ContextColumn) -> dict[str, Any]:
    """A column of the context: how its value becomes numbers, in the order in which the input has them."""
    how = {
        "number": "(value - mean) / scale",
        "hour": "sin and cos of 2 pi value / 24",
        "category": "one 0/1 number for each of `values` but the first",
    }[column.kind]
    return {**asdict(column), "values": list(column.values), "becomes": how}


def _numbers(values: Tensor) -> Any:
    """As lists of numbers; infinite bounds, which no draw breaks, as None: JSON has no infinity."""
    plain = values.detach().cpu().double().tolist()
    listed = plain if isinstance(plain, list) else [plain]
    kept = [value if abs(value) != float("inf") else None for value in listed]
    return kept if isinstance(plain, list) else kept[0]


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
        write_whole(path, content)
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
