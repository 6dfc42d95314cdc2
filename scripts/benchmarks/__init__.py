"""Measurements against peers and limits, one module for each part of the path."""
