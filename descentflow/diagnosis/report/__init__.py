"""The answer: printed, as a page, as JSON.

Read :mod:`~descentflow.diagnosis.report.page` first. The words stand in the templates next to it: ``words.txt.j2`` for
page and terminal, ``gap.html.j2`` and ``gap.txt.j2`` for one of them.
"""
