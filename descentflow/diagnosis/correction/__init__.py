"""Effects put into flights, and the simulator with them.

Reading order: :mod:`~descentflow.diagnosis.correction.effects_in_flights` and
:mod:`~descentflow.diagnosis.correction.flight_gaps` (effects put into flights),
:mod:`~descentflow.diagnosis.correction.corrected_descents` and
:mod:`~descentflow.diagnosis.correction.corrected_simulator` (the simulator with them).
"""
