"""Whole studies over the public functions, each with its figures and its page.

:mod:`~descentflow.studies.paper` repeats the paper's comparison of densities on thirteen types,
:mod:`~descentflow.studies.blind_diagnosis` hides effects from the diagnosis and scores what it finds, and
:mod:`~descentflow.studies.aircraft` draws the aircraft types. Programs that run them are in ``scripts/``.
"""
