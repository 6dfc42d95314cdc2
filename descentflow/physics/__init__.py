"""The equations of descent that hold for any aircraft: atmosphere, airspeeds and the total-energy equation.

Reading order: :mod:`~descentflow.physics.atmosphere`, :mod:`~descentflow.physics.airspeed`,
:mod:`~descentflow.physics.performance_model` (the protocol of drag, thrust, fuel, speeds and limits, which
:mod:`descentflow.aircraft_types` implements), :mod:`~descentflow.physics.energy` (rate from drag, and drag from the
rate), :mod:`~descentflow.physics.nominal_descent` (BADA's own descent). Drag is
inferred with :mod:`~descentflow.physics.idle_state` and flown with :mod:`~descentflow.physics.level_table`.

The sign of the rate is laid down in :mod:`~descentflow.physics.energy`, the thrust of a descent in ``idle_thrust_n`` of
the model. To fly climbs: both hold, with ``climb_thrust_n`` in place of idle. They need climb speeds in the protocol
(the APF file has them), times that grow upwards in :mod:`descentflow.representation.decoder.trajectories`, a bound
beside ``descends_too_slowly`` in :mod:`descentflow.representation.plausibility`, and a filter that keeps climbs in
:mod:`descentflow.surveillance.cleaning.descent_filters`.
"""
