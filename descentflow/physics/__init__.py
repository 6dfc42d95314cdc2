"""The equations of descent: atmosphere, airspeeds, forces and BADA 3's total-energy equation.

Reading order: :mod:`~descentflow.physics.atmosphere`, :mod:`~descentflow.physics.airspeed`,
:mod:`~descentflow.physics.forces` (drag and idle thrust, with :mod:`~descentflow.physics.configuration`,
:mod:`~descentflow.physics.envelope` and :mod:`~descentflow.physics.fuel`), :mod:`~descentflow.physics.energy` (rate
from drag, and drag from the rate), :mod:`~descentflow.physics.descent_speeds` and
:mod:`~descentflow.physics.transition` (Mach, then CAS), :mod:`~descentflow.physics.nominal_descent` (BADA's own
descent). The decoder uses :mod:`~descentflow.physics.idle_state` and, where speed counts,
:mod:`~descentflow.physics.fused_table`.

To fly climbs: :mod:`~descentflow.physics.energy` holds for them too, and :mod:`~descentflow.physics.forces` has the
maximum climb thrust. They need climb speeds beside those in :mod:`~descentflow.physics.descent_speeds` and in
:class:`~descentflow.aircraft_types.aircraft.Aircraft` (the APF file has them), times that grow upwards in
:mod:`descentflow.representation.decoder.trajectories`, a bound for them beside ``descends_too_slowly`` in
:mod:`descentflow.representation.plausibility`, and a filter that keeps climbs beside the one that keeps descents in
:mod:`descentflow.surveillance.cleaning.filters`.

To fly another performance model, BADA 4 for instance: its drag and thrust go into
:mod:`~descentflow.physics.forces`, its coefficients into :mod:`descentflow.aircraft_types`.
"""
