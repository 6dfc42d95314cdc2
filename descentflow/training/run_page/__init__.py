"""A run in one page: settings, loss curves, scores beside noise floors, rejections, profiles against held-out flights.

Reading order: :mod:`~descentflow.training.run_page.run_page` (what `descentflow open` calls),
:mod:`~descentflow.training.run_page.found_run` (where a run's files are),
:mod:`~descentflow.training.run_page.run_history` (what was logged while it trained),
:mod:`~descentflow.training.run_page.history_figures`, :mod:`~descentflow.training.run_page.run_sections`.
"""
