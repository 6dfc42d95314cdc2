"""Samples in bluebird-dt 0.4: a predictor that flies them (``.py``)."""

from pathlib import Path

from descentflow.exports._plugin import write_plugin
from descentflow.exports.export_request import ExportRequest


def write(request: ExportRequest, *others: ExportRequest) -> list[Path]:
    """Write the predictor ``NAME.py`` and its samples ``NAME.json``.

    Example:
        >>> from descentflow.densities.checkpoint import load_model
        >>> [path.name for path in write(ExportRequest(load_model("best.ckpt"), Path("bird.py"), n=5))]
        ['bird.py', 'bird.json']
    """
    return write_plugin("bluebird_predictor.py", request, *others)
