"""Both sides of a diagnosis: opened, measured, and as vectors of the same entries.

Reading order: :mod:`~descentflow.diagnosis.sides.diagnosis_inputs` (opens flights and simulators),
:mod:`~descentflow.diagnosis.sides.measured_sides` (measures them), :mod:`~descentflow.diagnosis.sides.vectors` and
:mod:`~descentflow.diagnosis.sides.two_sides` (flights as vectors), :mod:`~descentflow.diagnosis.sides.compared_state`
(the state of each flight) and :mod:`~descentflow.diagnosis.sides.simulator_coefficients` (the aircraft that a
simulator's own flights show). :mod:`~descentflow.diagnosis.sides.assumptions` has every constant of the diagnosis.
"""
