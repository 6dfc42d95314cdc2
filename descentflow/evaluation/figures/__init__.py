"""Figures of an evaluation: functions that return a matplotlib Figure and write nothing.

Read :mod:`~descentflow.evaluation.figures.profile_bands` first; the others need none of each other.
"""
