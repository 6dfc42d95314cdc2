"""Document of samples that lies beside the plugins for BlueSky and bluebird-dt, which read it as JSON."""

from typing import Any

import numpy as np

from descentflow.core.version import __version__
from descentflow.exports.columns import COLUMNS
from descentflow.exports.export_request import ExportRequest

FORMAT = "descentflow-samples"
VERSION = 1
ONCE = "top_of_descent_nm"
"""Column with one value for each sample."""
DECIMALS = {"latitude": 7, "longitude": 7, "Mach": 6}
"""Digits kept after the point; 4 of all other columns: a millimetre a second, a decimetre, a tenth of a millisecond."""


def document(request: ExportRequest) -> dict[str, Any]:
    """Model, units, and an object for each sample with its columns from the top down."""
    table = request.flights()
    about = [name for name in table.columns if name.startswith("given_")]
    columns = [name for name in table.columns if name not in (ONCE, *about) and name not in table.columns[:5]]
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
            ONCE: round(row[ONCE], 4),
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
        "units": {name: COLUMNS[name].unit for name in (*columns, ONCE)},
        "samples": samples,
    }
