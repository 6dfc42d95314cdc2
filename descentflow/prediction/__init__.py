"""Given the first part of an observed descent, the distribution of the rest of it."""
