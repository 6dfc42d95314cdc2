"""Plausibility bounds and rejection sampling, with an account of every draw."""
