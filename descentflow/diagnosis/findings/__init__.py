"""What a diagnosis finds, as typed objects that know nothing of how they were found.

Read :mod:`~descentflow.diagnosis.findings.findings` (the whole), then
:mod:`~descentflow.diagnosis.findings.cause_found` and :mod:`~descentflow.diagnosis.findings.gap_found` (its parts);
:mod:`~descentflow.diagnosis.findings.plain_values` makes the content of `gap.json` of them.
"""
