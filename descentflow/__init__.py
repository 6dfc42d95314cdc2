"""Realistic aircraft descents, learnt from surveillance data and flown by BADA's total-energy equation."""

from descentflow.core.version import __version__

__all__ = ["__version__"]
