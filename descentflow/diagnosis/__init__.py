"""Differences between a simulator and real flights: where, by which unmodelled effect, and how far the gap shrinks.

Reading order: :mod:`~descentflow.diagnosis.diagnose` (the order of all),
:mod:`~descentflow.diagnosis.diagnosis_steps` (the steps), and the rooms in the order of a diagnosis:
:mod:`~descentflow.diagnosis.sides` (both sides, opened and measured), :mod:`~descentflow.diagnosis.gap` (where they
differ and how much), :mod:`~descentflow.diagnosis.inference` (which effect),
:mod:`~descentflow.diagnosis.correction` (the simulator with it), :mod:`~descentflow.diagnosis.findings` (the answer as
typed objects) and :mod:`~descentflow.diagnosis.report` (the answer as a page).
The effects themselves are in :mod:`descentflow.effects`.
"""
