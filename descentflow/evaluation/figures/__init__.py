"""Figures of an evaluation: functions that return a matplotlib Figure and write nothing."""
