"""Realistic aircraft descents, learnt from surveillance data and flown by BADA's total-energy equation."""

__version__ = "0.1.0"
