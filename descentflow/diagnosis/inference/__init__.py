"""Measurements of both sides of a diagnosis, and cells that differ by more than chance.

:mod:`~descentflow.diagnosis.inference.two_sides` (flights as vectors),
:mod:`~descentflow.diagnosis.inference.compared_state`, :mod:`~descentflow.diagnosis.inference.turns_of_flights`,
:mod:`~descentflow.diagnosis.inference.reference_coefficients` (what the simulator's own flights say of its aircraft);
:mod:`~descentflow.diagnosis.inference.cells`, :mod:`~descentflow.diagnosis.inference.labellings`,
:mod:`~descentflow.diagnosis.inference.step_down`, :mod:`~descentflow.diagnosis.inference.gap_distances`,
:mod:`~descentflow.diagnosis.inference.where` (cells of quantity and altitude against permuted aircraft). Causes are
weighed in :mod:`descentflow.diagnosis.evidence`.
"""
