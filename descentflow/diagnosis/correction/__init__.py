"""Gap that is left once effects are in the simulator, and the simulator with them.

Reading order: :mod:`~descentflow.diagnosis.correction.effects_in_flights` and
:mod:`~descentflow.diagnosis.correction.flight_gaps` (effects put into flights),
:mod:`~descentflow.diagnosis.correction.measured_gap` and :mod:`~descentflow.diagnosis.correction.costs` (the gap before
and after), :mod:`~descentflow.diagnosis.correction.corrected_descents` and
:mod:`~descentflow.diagnosis.correction.corrected_simulator` (the simulator with them),
:mod:`~descentflow.diagnosis.correction.previous_round` (an earlier diagnosis, checked).
"""
