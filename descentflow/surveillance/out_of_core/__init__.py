"""Rows that do not fit in memory: spread over partitions of whole aircraft on disk, cleaned one by one, resumable.

Reading order: ``_resumable_run`` (the way from files to a written result), ``_groups`` (reading, group by group),
:mod:`~descentflow.surveillance.out_of_core.spill` and ``_partitions`` (rows that do not), ``_job`` (the folder of work,
and how a run is resumed).
"""
