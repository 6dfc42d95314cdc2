"""Commands that are killed at random instants and run again: ``scripts/kill.py``."""
