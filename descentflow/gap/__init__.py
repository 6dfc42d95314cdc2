"""Diagnosis of the sim-to-real gap: where it lies, which unmodelled effect causes it, how far it shrinks."""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from descentflow.diagnosis import NominalSimulator, diagnose
    from descentflow.gap.effects import EFFECTS, Effect
    from descentflow.gap.report import GapReport

__all__ = ["EFFECTS", "Effect", "GapReport", "NominalSimulator", "diagnose"]

_HOMES = {
    "EFFECTS": "descentflow.gap.effects",
    "Effect": "descentflow.gap.effects",
    "GapReport": "descentflow.gap.report",
    # Opens checkpoints, so it knows the trainer's side of the package, which nothing in this folder may.
    "NominalSimulator": "descentflow.diagnosis",
    "diagnose": "descentflow.diagnosis",
}


def __getattr__(name: str) -> Any:
    """Import a public name when it is asked for: torch is slow to load."""
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(_HOMES[name]), name)
