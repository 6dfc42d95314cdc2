"""Differences between a simulator and real flights: where, by which unmodelled effect, and how far the gap shrinks.

Reading order: :mod:`~descentflow.diagnosis.diagnose` (the order of all),
:mod:`~descentflow.diagnosis.diagnosis_inputs` (opens flights and simulators),
:mod:`~descentflow.diagnosis.diagnosis_steps` (the steps), :mod:`~descentflow.diagnosis.inference` (which effect),
:mod:`~descentflow.diagnosis.verdict` (a gap or none, explained or not), :mod:`~descentflow.diagnosis.correction` (how
far the gap shrinks), :mod:`~descentflow.diagnosis.report` (the answer).
The effects themselves are in :mod:`descentflow.effects`.
"""
