"""Trace a sampler for any number of descents, without what a trace remembers of the machine that made it."""

import logging
import warnings
from collections.abc import Iterator
from contextlib import contextmanager

import torch
from torch import Tensor, nn
from torch.export import Dim, ExportedProgram

TRACED_WITH = 7
"""Descents of the example that is traced: more than one, or torch would take the batch to be one descent always."""


def trace(module: nn.Module, inputs: dict[str, Tensor]) -> ExportedProgram:
    """The program of a module whose inputs all have the number of descents as first dimension.

    Args:
        module: In evaluation mode.
        inputs: An example of :data:`TRACED_WITH` descents, by argument.

    Example:
        >>> from descentflow.densities.checkpoint import load_model
        >>> from descentflow.exports.descent_graph import SamplerGraph
        >>> sampler = SamplerGraph(load_model("best.ckpt"))
        >>> program = trace(sampler, sampler.example_inputs(TRACED_WITH))
        >>> program.module()(**sampler.example_inputs(20))["time_s"].shape
        torch.Size([20, ...])
    """
    batch = Dim("n")
    with quiet_tracing(), torch.no_grad():
        program = torch.export.export(module, (), inputs, dynamic_shapes={name: {0: batch} for name in inputs})
    for part in program.graph_module.modules():
        if isinstance(part, torch.fx.GraphModule):
            for node in part.graph.nodes:
                # Lines of source files, with the folders in which they lie on this machine.
                node.meta.pop("stack_trace", None)
    return program


@contextmanager
def quiet_tracing() -> Iterator[None]:
    """Without the remarks that torch and its converter make on libraries and on their own deprecated parts.

    Example:
        >>> import warnings
        >>> with quiet_tracing():
        ...     warnings.warn("torchvision is not installed")
    """
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
