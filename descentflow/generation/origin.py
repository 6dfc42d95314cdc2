"""Origin of samples, for the metadata of files."""

from datetime import UTC, datetime

import torch

from descentflow.core.version import __version__
from descentflow.densities.density import Density


def origin_of(density: Density, seed: int) -> dict[str, str]:
    """Names and texts for the metadata of a file; the checkpoint is that which :func:`.checkpoint.load_model` read.

    Example:
        >>> from descentflow.densities.checkpoint import load_model
        >>> origin_of(load_model("best.ckpt"), seed=3)
        {'source': 'descentflow ..., torch ...', 'model': 'GaussianDensity', 'typecode': 'A320', \
'fitted_to': '86 of 120 flights (...)', 'seed': '3', 'date_created': '...Z', 'checkpoint': 'best.ckpt', \
'checkpoint_sha256': '...'}
    """
    return {
        "source": f"descentflow {__version__}, torch {torch.__version__}",
        "model": type(density).__name__,
        "typecode": density.representation.decoder.aircraft.typecode,
        "fitted_to": density.representation.split.describe(),
        "seed": str(seed),
        "date_created": datetime.now(UTC).strftime("%Y-%m-%dT%H:%M:%SZ"),
        **density.file,
    }
