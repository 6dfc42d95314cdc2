"""The sampler and its decoder as programs of `torch.export` (``.pt2``), which run without descentflow."""

import json
from pathlib import Path

import torch
from torch.export import ExportedProgram

from descentflow.core.files import whole_file
from descentflow.exports.descent_graph import SamplerGraph
from descentflow.exports.export_request import ExportRequest
from descentflow.exports.graph_description import decoder_inputs, describe
from descentflow.exports.graph_figures import figures
from descentflow.exports.traced import TRACED_WITH, quiet_tracing, trace

DESCRIPTION = "descentflow.json"
"""Extra file of a program that holds its description."""


def write(request: ExportRequest) -> list[Path]:
    """Write the sampler ``NAME.pt2``, its decoder ``NAME_decoder.pt2``, and what both take and give, ``NAME.json``.

    Raises:
        ConfigError: If the density or the decoder cannot be exported.

    Example:
        >>> from descentflow.densities.checkpoint import load_model
        >>> paths = write(ExportRequest(load_model("best.ckpt"), Path("sampler.pt2")))
        >>> [path.name for path in paths]
        ['sampler.pt2', 'sampler_decoder.pt2', 'sampler.json']
        >>> draw = torch.export.load("sampler.pt2").module()
        >>> descents = draw(**SamplerGraph(load_model("best.ckpt")).example_inputs(5))  # noise, entry_fl, ...
        >>> descents["time_s"].shape
        torch.Size([5, ...])
    """
    sampler = SamplerGraph(request.density, request.precision).eval()
    description = json.dumps(describe(request.density, sampler, request.precision), indent=1)
    programs = {
        request.path: trace(sampler, sampler.example_inputs(TRACED_WITH)),
        decoder_path(request.path): trace(sampler.descents, decoder_inputs(sampler, TRACED_WITH)),
    }
    beside = request.beside(".json", f"{description}\n".encode())
    for path, program in programs.items():
        with whole_file(path) as temporary, quiet_tracing():
            torch.export.save(program, temporary, extra_files={DESCRIPTION: description})
    with whole_file(beside) as temporary:
        temporary.write_text(description + "\n", encoding="utf-8")
    if request.report is not None:
        request.report(_figures(sampler, torch.export.load(request.path), request.path))
    return [*programs, beside]


def decoder_path(path: Path) -> Path:
    """Where the decoder of a sampler is written.

    Example:
        >>> decoder_path(Path("a320.onnx")).name
        'a320_decoder.onnx'
    """
    return path.with_name(f"{path.stem}_decoder{path.suffix}")


def _figures(sampler: SamplerGraph, program: ExportedProgram, path: Path) -> str:
    module, threads = program.module(), torch.get_num_threads()
    runtime = f"torch {torch.__version__}, {threads} thread{'s' * (threads > 1)}"
    with torch.no_grad():
        return figures(sampler, lambda inputs: module(**inputs), path, runtime)
