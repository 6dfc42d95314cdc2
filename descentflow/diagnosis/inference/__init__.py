"""Inference of the diagnosis: what is measured of both sides, which effects explain how they differ, and how surely.

Read :mod:`~descentflow.diagnosis.inference.explain` for the steps, and
:mod:`~descentflow.diagnosis.inference.assumptions` for every constant.

- Flights as vectors: ``two_sides``, ``compared_state``, and ``simulator_coefficients`` (what its own flights say of the
  aircraft that a simulator flies).
- Whether and where they differ: ``labellings``, ``where`` (cells of quantity and altitude against permuted aircraft).
- The means of both sides: ``moments``, ``signatures``, ``candidates``, ``linear_gaussian``, ``sets``, ``naming``.
- The shapes of single flights: ``flight_rates``, ``flight_mixture``, ``flight_effects``.
"""
