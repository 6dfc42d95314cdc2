"""Samples in bluebird-dt 0.4: tables that it reads (``.json``), or a predictor that flies samples (``.py``)."""

import json
from pathlib import Path
from typing import Any

from descentflow.core.files import whole_file
from descentflow.exports.bluebird_tables import tables
from descentflow.exports.export_request import ExportRequest
from descentflow.exports.plugin import write_plugin


def write(request: ExportRequest, *others: ExportRequest) -> list[Path]:
    """Write the predictor ``NAME.py`` and its samples ``NAME.json``; or, for ``NAME.json``, three tables beside it.

    The tables are ``NAME_profile.json``, ``NAME_uncertainty.json`` and ``NAME_mapping.json``.

    Raises:
        DataError: If there are too few samples for tables.

    Example:
        >>> from descentflow.densities.checkpoint import load_model
        >>> [path.name for path in write(ExportRequest(load_model("best.ckpt"), Path("bird.py"), n=5))]
        ['bird.py', 'bird.json']
    """
    if request.path.suffix == ".py":
        return write_plugin("bluebird_predictor.py", request, *others)
    written = []
    for kind, table in tables_of_models(request, *others).items():
        written.append(request.path.with_name(f"{request.path.stem}_{kind}.json"))
        with whole_file(written[-1]) as temporary:
            temporary.write_text(json.dumps(table, indent=1), encoding="utf-8")
    return written


def tables_of_models(*requests: ExportRequest) -> dict[str, dict[str, Any]]:
    """Profile, uncertainty and mapping of every model; other types fly as the first."""
    profile, uncertainty, mapping = {}, {}, {"DEFAULT": requests[0].typecode}
    for each in requests:
        profile[each.typecode], uncertainty[each.typecode] = tables(each.samples.to_polars())
        mapping |= dict.fromkeys(each.types, each.typecode)
    return {"profile": {"aircraft": profile}, "uncertainty": {"aircraft": uncertainty}, "mapping": mapping}
