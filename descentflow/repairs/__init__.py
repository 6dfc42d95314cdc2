"""Repair of a type's coefficients by real flights: CD0, CD2 and idle thrust about the reference mass, crews' speeds.

Reading order: :mod:`~descentflow.repairs.repair` (the front door), :mod:`~descentflow.repairs.flight_evidence` (rates
of flights and the energy equation), :mod:`~descentflow.repairs.mixed_model` (the statistics, on arrays alone),
:mod:`~descentflow.repairs.type_fit` (both together); :mod:`~descentflow.repairs.held_out` judges, and
:mod:`~descentflow.repairs.repaired_files` writes.
"""
