"""Samples in bluebird-dt 0.4: tables that it reads (``.json``), or a predictor that flies samples (``.py``)."""

import json
from importlib import resources
from pathlib import Path

import orjson

from descentflow.core.files import whole_file
from descentflow.exports.bluebird_tables import tables
from descentflow.exports.export_request import ExportRequest
from descentflow.exports.samples_document import document


def write(request: ExportRequest) -> list[Path]:
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
        name = "templates/bluebird_predictor.py"
        predictor = resources.files("descentflow.exports").joinpath(name).read_bytes()
        samples = orjson.dumps(document(request), option=orjson.OPT_SERIALIZE_NUMPY)
        contents = {request.beside(".json", samples): samples, request.path: predictor}
    else:
        made = tables(request.samples.to_polars(), request.typecode)
        contents = {
            request.path.with_name(f"{request.path.stem}_{kind}.json"): json.dumps(table, indent=1).encode()
            for kind, table in zip(("profile", "uncertainty", "mapping"), made, strict=True)
        }
    for path, content in contents.items():
        with whole_file(path) as temporary:
            temporary.write_bytes(content)
    return sorted(contents, key=lambda path: path.suffix != request.path.suffix)
