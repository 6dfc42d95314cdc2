"""Inference of the diagnosis: which effects explain how both sides differ, and how surely.

Read :mod:`~descentflow.diagnosis.inference.explain` for the steps.

- The means of both sides: ``moments``, ``signatures``, ``candidates``, ``sets``, ``naming``.
- The shapes of single flights: ``_flight_rates``, ``flight_mixture``, ``flight_effects``.
- The answer: ``verdict`` (a gap or none, explained or not), ``_described`` (causes as findings).
"""
