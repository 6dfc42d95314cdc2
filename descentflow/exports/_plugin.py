"""Plugins of other programs: a Python file of ours that the program loads, and with it the samples that it flies."""

from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np
import orjson

from descentflow.core.errors import ConfigError
from descentflow.core.files import write_whole
from descentflow.core.version import __version__
from descentflow.exports.export_request import ExportRequest

FLOWN = ("level_fl", "vertical_rate", "CAS")
NAME = "DESCENTFLOW"
"""Stands in a template for the name of the plugin's file."""


def write_plugin(template: str, request: ExportRequest, *others: ExportRequest) -> list[Path]:
    """Write the plugin, and its samples in the same folder as JSON.

    Args:
        template: A file of ``templates``.
        request: The output, and the samples of one model.
        others: Those of other models.

    Returns:
        Both files, the plugin first.

    Raises:
        ConfigError: If Python could not import a file of that name, or a file of that name is not its own.

    Example:
        >>> from descentflow.densities.checkpoint import load_model
        >>> made = write_plugin("bluesky_plugin.py", ExportRequest(load_model("best.ckpt"), Path("flown.py"), n=5))
        >>> [path.name for path in made]
        ['flown.py', 'flown.json']
    """
    name = request.path.stem
    if not name.isidentifier():
        raise ConfigError(
            f"{request.path.name}, which Python cannot import",
            expected="letters, digits and underscores",
            mend="rename the output, for instance descents.py",
        )
    source = resources.files("descentflow.exports").joinpath("templates", template).read_text(encoding="utf-8")
    samples = orjson.dumps(document(request, *others), option=orjson.OPT_SERIALIZE_NUMPY)
    beside = request.beside(".json", samples)
    for path, content in ((beside, samples), (request.path, source.replace(NAME, name.upper()).encode())):
        write_whole(path, content)
    return [request.path, beside]


def document(*requests: ExportRequest) -> dict[str, Any]:
    """For each model the types that it flies and its samples, from the top down: FL, ft/min and kt."""
    fleet = []
    for request in requests:
        table = request.samples.to_polars()
        starts = np.flatnonzero(np.diff(table["sample_id"].to_numpy(), prepend=-1))[1:]
        parts = [np.split(table[name].to_numpy().round(4), starts) for name in FLOWN]
        samples = [dict(zip(FLOWN, columns, strict=True)) for columns in zip(*parts, strict=True)]
        fleet.append({"types": request.types, "seed": request.seed, "samples": samples})
    return {"made_by": f"descentflow {__version__}", "fleet": fleet}
