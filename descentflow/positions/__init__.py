"""Places of a descent: distance over the ground and coordinates, from true airspeed and wind.

Reading order: :mod:`~descentflow.positions.ground_plan` (a user's input: an end point or a route, a wind, a time),
:mod:`~descentflow.positions.ground_path` (the line over the ground), :mod:`~descentflow.positions.wind` (the wind),
:mod:`~descentflow.positions.placing` (the integration).
"""
