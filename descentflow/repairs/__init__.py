"""Repair of a type's coefficients by real flights: CD0, CD2 and idle thrust about the reference mass, crews' speeds.

Reading order: :mod:`~descentflow.repairs.repair` (the front door), ``_flight_evidence`` (rates of flights and the
energy equation), :mod:`~descentflow.repairs.mixed_model` (the statistics, on arrays alone), ``_type_fit`` (both
together); ``_held_out`` judges, and :mod:`~descentflow.repairs.repaired_files` writes.
"""
