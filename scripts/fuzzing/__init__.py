"""Damaged inputs of every kind, and what each command makes of them: ``scripts/fuzz.py``."""
