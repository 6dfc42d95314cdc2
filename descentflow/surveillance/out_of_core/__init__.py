"""Preparing rows that do not fit in memory: spilled by aircraft, cleaned in batches, resumable."""
