"""The answer: typed results, text, figures, `gap.json` and the page.

Read :mod:`~descentflow.diagnosis.report.gap_report` first.
"""
