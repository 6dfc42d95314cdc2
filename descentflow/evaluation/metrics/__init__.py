"""Distances between samples and held-out flights, each with its real-against-real floor.

Reading order: :mod:`~descentflow.evaluation.metrics.score_registry` (the scored quantities),
:mod:`~descentflow.evaluation.metrics.statistic_kinds` (what an entry is), :mod:`~descentflow.evaluation.metrics.scores`
(how all are computed), then :mod:`~descentflow.evaluation.metrics.distances` and
:mod:`~descentflow.evaluation.metrics.noise_floor`.
"""
