"""The rest of a descent, given its first part: time intervals.

Reading order: :mod:`~descentflow.generation.prediction.predict` (what a user calls),
:mod:`~descentflow.generation.prediction.predictor` (one flight), ``_latent_density`` (the density given what it flew).
"""
