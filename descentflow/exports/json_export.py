"""Samples as one JSON document for programs in other languages, with the JSON schema that says what is in it."""

import json
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np
import orjson

from descentflow.core.files import whole_file
from descentflow.core.version import __version__
from descentflow.exports.columns import COLUMNS
from descentflow.exports.export_request import ExportRequest

FORMAT = "descentflow-samples"
VERSION = 1
ONCE = ("top_of_descent_nm", "mass_kg")
"""Columns with one value for each sample; the mass where samples have their own."""
DECIMALS = {"latitude": 7, "longitude": 7, "Mach": 6}
"""Digits kept after the point; 4 of all other columns: a millimetre a second, a decimetre, a tenth of a millisecond."""


def schema() -> dict[str, Any]:
    """The JSON schema (draft 2020-12) of the document.

    Example:
        >>> schema()["title"]
        'Sampled aircraft descents'
    """
    text = resources.files("descentflow.exports").joinpath("samples.schema.json").read_text(encoding="utf-8")
    found: dict[str, Any] = json.loads(text)
    return found


def document(request: ExportRequest) -> dict[str, Any]:
    """The document: about the model, the units, and an object for each sample with its columns from the top down.

    Example:
        >>> from descentflow.densities.checkpoint import load_model
        >>> made = document(ExportRequest(load_model("best.ckpt"), Path("s.json"), n=2))
        >>> len(made["samples"]), float(made["samples"][0]["time_s"][0]), made["units"]["CAS"]
        (2, 0.0, 'knot')
    """
    table = request.flights()
    about = [name for name in table.columns if name.startswith("given_")]
    once = [name for name in ONCE if name in table.columns]
    columns = [name for name in table.columns if name not in (*once, *about) and name not in table.columns[:5]]
    first = table.unique("sample_id", keep="first", maintain_order=True).rows(named=True)
    starts = np.flatnonzero(np.diff(table["sample_id"].to_numpy(), prepend=-1))
    values = {
        name: np.split(table[name].to_numpy().round(DECIMALS.get(name, 4)), starts[1:])
        for name in columns
        if name != "timestamp"
    }
    if "timestamp" in columns:
        texts = table["timestamp"].dt.strftime("%Y-%m-%dT%H:%M:%S%.3fZ").to_numpy()
        values["timestamp"] = [part.tolist() for part in np.split(texts, starts[1:])]
    samples = [
        {
            "sample_id": row["sample_id"],
            "callsign": row["callsign"],
            **({"given": {name.removeprefix("given_"): row[name] for name in about}} if about else {}),
            **{name: round(row[name], 4) for name in once},
            **{name: parts[i] for name, parts in values.items()},
        }
        for i, row in enumerate(first)
    ]
    return {
        "format": FORMAT,
        "version": VERSION,
        "made_by": f"descentflow {__version__}",
        "typecode": request.typecode,
        "seed": request.seed,
        "units": {name: COLUMNS[name].unit for name in (*columns, *once)},
        "samples": samples,
    }


def write(request: ExportRequest) -> list[Path]:
    """Write the document, and its schema beside it as ``NAME.schema.json``.

    Example:
        >>> from descentflow.densities.checkpoint import load_model
        >>> [path.name for path in write(ExportRequest(load_model("best.ckpt"), Path("s.json"), n=2))]
        ['s.json', 's.schema.json']
    """
    beside = request.path.with_suffix(".schema.json")
    content = orjson.dumps(document(request), option=orjson.OPT_SERIALIZE_NUMPY)
    with whole_file(request.path) as temporary:
        temporary.write_bytes(content)
    with whole_file(beside) as temporary:
        temporary.write_text(json.dumps(schema(), indent=2) + "\n", encoding="utf-8")
    return [request.path, beside]
