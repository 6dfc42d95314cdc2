"""The equations of descent that hold for any aircraft: atmosphere, airspeeds and the total-energy equation.

Reading order: :mod:`~descentflow.physics.atmosphere`, :mod:`~descentflow.physics.airspeed`,
:mod:`~descentflow.physics.performance_model` (the protocol of drag, thrust, fuel, speeds and limits, which
:mod:`descentflow.aircraft_types` implements), :mod:`~descentflow.physics.energy` (rate from drag, and drag from the
rate), :mod:`~descentflow.physics.nominal_descent` (BADA's own descent). Drag is
inferred with :mod:`~descentflow.physics.idle_state` and flown with :mod:`~descentflow.physics.level_table`.

The sign of the rate is laid down in :mod:`~descentflow.physics.energy`, the thrust of a descent in ``idle_thrust_n`` of
the model. What climbs need, folder by folder:

- here: climb speeds in the protocol (the APF file has them), ``climb_thrust_n`` in place of idle in
  :mod:`~descentflow.physics.idle_state`, :mod:`~descentflow.physics.level_table` and
  :mod:`~descentflow.physics.nominal_descent`;
- ``surveillance/cleaning``: filters that keep climbs in ``descent_filters`` and ``rates``, levels counted upwards in
  ``level_grid``;
- ``representation``: in ``profiles`` an entry at the lowest level, which the masks of ``decoder/trajectories`` and the
  ``residuals`` take; times that grow upwards there; a scale of thrust minus drag in ``drag_scale``; the rule
  ``descends_too_slowly`` and its bound below zero in ``plausibility``;
- ``air``: the thrust of ``energy_in_air``;
- ``measurements``, ``effects/flight_state``, ``representation/correction`` and ``diagnosis/correction``: logarithms of
  a rate of descent;
- wherever times and distances are differences from the top: ``positions/placing``, ``burnt_kg``, ``flown_in``,
  ``DescentSet.time_to_bottom_s`` and ``prediction/time_calibration``;
- ``evaluation/metrics/score_registry``: the time from the highest level to the lowest; ``exports/bluebird_tables``;
- ``generation``: levels above the entry in ``sample_contexts``, ``conditional/constraints`` and
  ``prediction/predictor``, the sign of the rate there, in ``conditional/draws`` and in ``conditional/flown_so_far``.
"""
