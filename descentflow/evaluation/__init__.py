"""Comparison of samples with held-out flights: scores with their noise floor, and figures.

Reading order: :mod:`~descentflow.evaluation.evaluate` (what a user calls),
:mod:`~descentflow.evaluation.evaluation_report` (what it returns),
:mod:`~descentflow.evaluation.metrics.score_registry` (the scored quantities),
:mod:`~descentflow.evaluation.metrics.scores` (how). To add a score, add an entry to
:data:`descentflow.evaluation.metrics.score_registry.STATISTICS`.
"""
