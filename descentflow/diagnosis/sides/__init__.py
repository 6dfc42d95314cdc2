"""Both sides of a diagnosis: opened, measured, and as vectors of the same entries.

Reading order: :mod:`~descentflow.diagnosis.sides.diagnosis_inputs` (opens flights and simulators),
:mod:`~descentflow.diagnosis.sides.measured_sides` (measures them), ``_vectors`` and
:mod:`~descentflow.diagnosis.sides.two_sides` (flights as vectors), :mod:`~descentflow.diagnosis.sides.compared_state`
(the state of each flight) and ``_simulator_coefficients`` (the aircraft that a simulator's own flights show).
:mod:`~descentflow.diagnosis.sides.assumptions` has every constant of the diagnosis.
"""
