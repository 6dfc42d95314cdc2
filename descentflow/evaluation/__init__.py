"""Samples held against held-out flights: metrics beside their noise floor, and figures.

Read :mod:`~descentflow.evaluation.evaluate`, then :mod:`~descentflow.evaluation.metrics.scores`.
"""
