"""The air that flights were in: temperature and wind along the track by level, measured by the aircraft or from a file.

Read :mod:`~descentflow.air.level_air` (temperature and wind on levels), then :mod:`~descentflow.air.air_reports` (what
an aircraft's reports say of them, with their errors) and :mod:`~descentflow.air.air_smoother` (profiles of them).
"""
