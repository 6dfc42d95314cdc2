"""Real flights that are known by times and altitudes alone, held against a simulator: seconds between flight levels.

Reading order: :mod:`.compare_times` (what `evaluate` and `diagnose` call), :mod:`.leg_statistics`, :mod:`.times_found`
(what it returns), :mod:`.times_page`.
"""
