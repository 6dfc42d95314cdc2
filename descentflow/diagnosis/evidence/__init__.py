"""Inference of the diagnosis: which effects explain how real flights differ from a simulator's, and how surely.

Read :mod:`~descentflow.diagnosis.evidence.explain` for the steps. The means of both sides:
:mod:`~descentflow.diagnosis.evidence.moments`, :mod:`~descentflow.diagnosis.evidence.signatures`,
:mod:`~descentflow.diagnosis.evidence.candidates`, :mod:`~descentflow.diagnosis.inference.linear_gaussian`,
:mod:`~descentflow.diagnosis.evidence.set_fit`, :mod:`~descentflow.diagnosis.evidence.best_sets`,
:mod:`~descentflow.diagnosis.evidence.naming`. The shapes of single flights:
:mod:`~descentflow.diagnosis.evidence.flight_rates`, :mod:`~descentflow.diagnosis.evidence.flight_spread`,
:mod:`~descentflow.diagnosis.evidence.flight_mixture`, :mod:`~descentflow.diagnosis.evidence.flight_effects`. All
constants: :mod:`~descentflow.diagnosis.evidence.assumptions`.
"""
