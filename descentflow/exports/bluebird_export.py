"""Samples in bluebird-dt 0.4: tables that it reads (``.json``), or a predictor that flies samples (``.py``)."""

import json
from pathlib import Path
from typing import Any

from descentflow.core.errors import ConfigError
from descentflow.core.files import whole_file
from descentflow.exports.bluebird_tables import KINDS, Tables, merged, read_tables, tables
from descentflow.exports.export_request import ExportRequest
from descentflow.exports.plugin import write_plugin


def write(request: ExportRequest, *others: ExportRequest) -> list[Path]:
    """Write the predictor ``NAME.py`` and its samples ``NAME.json``; or, for ``NAME.json``, three tables beside it.

    The tables are ``NAME_profile.json``, ``NAME_uncertainty.json`` and ``NAME_mapping.json``.

    Raises:
        ConfigError: If a predictor shall be put into tables.
        DataError: If there are too few samples for tables, or ``into`` names others than bluebird's.

    Example:
        >>> from descentflow.densities.checkpoint import load_model
        >>> [path.name for path in write(ExportRequest(load_model("best.ckpt"), Path("bird.py"), n=5))]
        ['bird.py', 'bird.json']
    """
    if request.path.suffix == ".py":
        if request.into:
            raise ConfigError(
                f"into {request.into[0]} for a predictor",
                expected="tables, NAME.json",
                mend="pass your tables to the predictor itself, as LinearPredictor takes them",
            )
        return write_plugin("bluebird_predictor.py", request, *others)
    paths = [request.path.with_name(f"{request.path.stem}_{kind}.json") for kind in KINDS]
    same = {path.resolve() for path in paths} & {Path(path).resolve() for path in request.into}
    if same:
        raise ConfigError(
            f"{same.pop()}, which would be written over", expected="tables beside yours", mend="choose another output"
        )
    made = tables_of_models(request, *others)
    made = merged(made, read_tables(request.into)) if request.into else made
    for path, kind in zip(paths, KINDS, strict=True):
        with whole_file(path) as temporary:
            temporary.write_text(json.dumps(made[kind], indent=1), encoding="utf-8")
    return paths


def tables_of_models(*requests: ExportRequest) -> Tables:
    """Profile, uncertainty and mapping of every model; other types fly as the first."""
    profile: dict[str, Any] = {}
    uncertainty: dict[str, Any] = {}
    mapping = {"DEFAULT": requests[0].typecode}
    for each in requests:
        profile[each.typecode], uncertainty[each.typecode] = tables(each.samples.to_polars())
        mapping |= dict.fromkeys(each.types, each.typecode)
    return {"profile": {"aircraft": profile}, "uncertainty": {"aircraft": uncertainty}, "mapping": mapping}
