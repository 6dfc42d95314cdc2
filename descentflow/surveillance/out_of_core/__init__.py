"""Rows that do not fit in memory: spread over partitions of whole aircraft on disk, cleaned one by one, resumable.

Reading order: :mod:`~descentflow.surveillance.out_of_core.resumable_run` (the way from files to a written result),
:mod:`~descentflow.surveillance.out_of_core.groups` (reading, group by group),
:mod:`~descentflow.surveillance.out_of_core.spill` and :mod:`~descentflow.surveillance.out_of_core.partitions` (rows
that do not), :mod:`~descentflow.surveillance.out_of_core.job` (the folder of work, and how a run is resumed).
"""
