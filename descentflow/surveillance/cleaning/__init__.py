"""From the rows of an aircraft to free descents on flight levels: filters that compose, and their thresholds.

Read :mod:`~descentflow.surveillance.cleaning.chain`, then :mod:`~descentflow.surveillance.cleaning.thresholds`.
"""
