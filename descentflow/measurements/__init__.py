"""Measurements of flights on bands of altitude: by training, for later, and by the diagnosis.

Read :mod:`~descentflow.measurements.level_channels` (channels on each level), then
:mod:`~descentflow.measurements.quantities` (quantities on each band).
"""
