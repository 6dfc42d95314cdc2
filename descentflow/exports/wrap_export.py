"""OpenAP's WRAP file of a type: distributions of what its descents do, the samples' in place of OpenAP's own."""

import warnings
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from descentflow.core.errors import DescentflowWarning
from descentflow.core.files import whole_file
from descentflow.core.tabular import optional_library
from descentflow.core.units import FL_M, FPM_MPS, KT_MPS, NM_M
from descentflow.exports.constant_speeds import constant_speeds
from descentflow.exports.export_request import ExportRequest
from descentflow.exports.wrap_models import WrapModel, fitted_model

Array = NDArray[np.float64]
COLUMNS = ("variable", "flight phase", "name", "opt", "min", "max", "model", "parameters")
WIDTHS = (22, 16, 39, 10, 10, 10, 9, 0)
NAMES = {
    "de_d_range": "Descent range",
    "de_v_mach_const": "Constant Mach",
    "de_v_cas_const": "Constant CAS",
    "de_h_mach_const": "Constant Mach crossover altitude",
    "de_vs_avg_mach_const": "Mean descent rate, constant-Mach",
    "de_vs_avg_cas_const": "Mean descent rate, constant-CAS",
}
"""Rows that samples can tell; what comes after the constant CAS is below most models' lowest level."""
FEWEST = 30
"""Samples that a distribution is fitted to."""


def write(request: ExportRequest) -> list[Path]:
    """Write the type's file: OpenAP's rows of its other phases, and the samples' rows of the descent.

    Raises:
        ConfigError: If OpenAP is not installed.

    Warns:
        DescentflowWarning: If OpenAP has no file of the type: then there are rows of the descent alone.

    Example:
        >>> from descentflow.densities.checkpoint import load_model
        >>> _ = write(ExportRequest(load_model("best.ckpt"), Path("a320.txt"), n=200))
        >>> Path("a320.txt").read_text().split()[0]
        'variable'
    """
    models = descent_models(request)
    rows = _openap_rows(request.typecode)
    own = {name: (name, "descent", NAMES[name], *model.words()) for name, model in models.items()}
    merged = [own.pop(row[0], row) for row in rows] + list(own.values())
    with whole_file(request.path) as temporary:
        temporary.write_text("\n".join(map(_line, (COLUMNS, *merged))) + "\n", encoding="ascii")
    return [request.path]


def descent_models(request: ExportRequest) -> dict[str, WrapModel]:
    """The distribution of each row of :data:`NAMES` over the samples, in WRAP's units: m/s, km and Mach.

    Example:
        >>> from descentflow.densities.checkpoint import load_model
        >>> models = descent_models(ExportRequest(load_model("best.ckpt"), Path("a320.txt"), n=200))
        >>> 110 < models["de_v_cas_const"].best < 170
        True
    """
    phases = constant_speeds(request.samples.to_polars())
    values = {
        "de_d_range": phases["top_of_descent_nm"] * NM_M / 1000,
        "de_v_mach_const": phases["mach"],
        "de_v_cas_const": phases["cas_kt"] * KT_MPS,
        "de_h_mach_const": phases["crossover_fl"] * FL_M / 1000,
        "de_vs_avg_mach_const": phases["mach_rate_fpm"] * FPM_MPS,
        "de_vs_avg_cas_const": phases["cas_rate_fpm"] * FPM_MPS,
    }
    known = {name: column.drop_nulls().to_numpy() for name, column in values.items()}
    return {name: fitted_model(own) for name, own in known.items() if len(own) >= FEWEST}


def _openap_rows(typecode: str) -> list[tuple[str, ...]]:
    """The rows of OpenAP's file of the type, or of the type that OpenAP takes for it."""
    openap: Any = optional_library("openap", extra="openap")
    try:
        table = openap.WRAP(ac=typecode).df
    except ValueError:
        warnings.warn(
            f"OpenAP has no WRAP of {typecode}: the file has rows of the descent alone, and OpenAP's other phases of "
            "this type cannot be read from it",
            DescentflowWarning,
            stacklevel=2,
        )
        return []
    return [tuple(str(value) for value in row) for row in table.itertuples(index=False)]


def _line(words: tuple[str, ...]) -> str:
    return "".join(f"{word:<{width}}" for word, width in zip(words, WIDTHS, strict=True)).rstrip()
