"""The paper's study: thirteen types, four densities, tables, figures, sweeps and one page.

Read :mod:`~descentflow.studies.paper.study_plan`, then :mod:`~descentflow.studies.paper.steps`.
"""
