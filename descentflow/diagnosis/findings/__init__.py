"""Findings of a diagnosis, as typed objects that know nothing of how they were found.

Read :mod:`~descentflow.diagnosis.findings.findings` (the whole), then its parts:
:mod:`~descentflow.diagnosis.findings.gap_found` (where), :mod:`~descentflow.diagnosis.findings.costs_found` (what it
costs), :mod:`~descentflow.diagnosis.findings.cause_found` (why),
:mod:`~descentflow.diagnosis.findings.correction_found` (what to do) and
:mod:`~descentflow.diagnosis.findings.inputs_found` (what went in). :mod:`~descentflow.diagnosis.findings.plain_values`
makes the content of `gap.json` of them, and :mod:`~descentflow.diagnosis.findings.read_gap` makes them of it.
``_sizes`` has the words of a size, :mod:`~descentflow.diagnosis.findings.aviation_units` those of a difference.
"""
