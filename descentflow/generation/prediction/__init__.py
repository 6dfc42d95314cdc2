"""The rest of a descent given its first part: time intervals and occupancy of levels.

Read :mod:`~descentflow.generation.prediction.predictor` first.
"""
