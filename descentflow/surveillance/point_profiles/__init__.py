"""Points of network managers' flight profiles: times and altitudes, no airspeeds; good for times to levels alone.

Reading order: :mod:`.read_points` (what is called), :mod:`.so6` and :mod:`.allft` (the two formats of EUROCONTROL's
DDR2 and NEST), :mod:`.level_times` (points to seconds between levels).
"""
