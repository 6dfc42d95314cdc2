"""Plausible descents from a density: rejection sampling, tables for export, and prediction in flight.

Read :mod:`~descentflow.generation.rejection`, then :mod:`~descentflow.generation.prediction`.
"""
