"""Figures that only the paper's study draws."""
