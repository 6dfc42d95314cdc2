"""The paper's study: thirteen types, four densities, tables, figures, sweeps and one page.

Reading order: :mod:`~studies.paper.study_plan` (what is studied),
:mod:`~studies.paper.steps` (the work of one type), :mod:`~studies.paper.study_run` (all types,
resumed and spread over workers), :mod:`~studies.paper.study_tables`,
:mod:`~studies.paper.fidelity_tables`, :mod:`~studies.paper.study_report` (the page, of
:mod:`~studies.paper.study_sections` and :mod:`~studies.paper.fidelity_sections`), and
:mod:`~studies.paper.sweeps` for the appendices.

A study's folder holds ``plan.json``, and for each type ``descents.parquet``, a folder per model (``model.ckpt``,
``scores.csv``, ``intervals.csv``, ``classifier.csv``, ``rejections.json``, logs and, last, ``done``), figures,
``nll.csv`` and, last, ``flights.json``; the tables as CSV and ``report.html`` lie next to the types.
"""
