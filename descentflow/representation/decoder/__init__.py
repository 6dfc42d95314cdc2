"""From weights to trajectories: drag and CAS, then batched total-energy integration.

Reading order: :mod:`~descentflow.representation.decoder.descent_decoder`,
:mod:`~descentflow.representation.decoder.trajectories` (integration),
:mod:`~descentflow.representation.decoder.flight_grid` (constants of the levels, and where the rate jumps).

Descents alone are flown: what climbs need is in :mod:`descentflow.physics`.
"""
