"""Whole studies over the public functions, each with its figures and its page."""
