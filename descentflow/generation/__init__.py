"""Plausible descents from a density, and the rest of a descent that has begun.

Reading order: :mod:`~descentflow.generation.sample` (what a user calls), :mod:`~descentflow.generation.rejection` (the
one rejection loop), :mod:`~descentflow.generation.samples` (what it returns),
:mod:`~descentflow.generation.prediction.predict` (prediction in flight),
:mod:`~descentflow.generation.conditional.generator` (descents that meet constraints, for a running simulator). To
change the rejection bounds, see :mod:`descentflow.representation.plausibility`.

Descents alone are generated: what climbs need is in :mod:`descentflow.physics`.
"""
