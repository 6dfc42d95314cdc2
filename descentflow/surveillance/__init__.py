"""From surveillance rows to free descents; every row that is dropped is counted.

Reading order: :mod:`~descentflow.surveillance.prepare` (all of it in order), :mod:`~descentflow.surveillance.read_rows`
(the stages of reading), ``_intake`` (usable rows, and those in memory to descents), then the folders in that order:
:mod:`~descentflow.surveillance.unpacking` (paths to streams of bytes), :mod:`~descentflow.surveillance.formats`
(streams to tables; a source of rows is added here), :mod:`~descentflow.surveillance.rows` (tables to rows in one
schema), :mod:`~descentflow.surveillance.cleaning` (rows to free descents on flight levels; thresholds are changed
here), :mod:`~descentflow.surveillance.out_of_core` (rows that do not fit in memory),
:mod:`~descentflow.surveillance.descents` (the result). Next to them, :mod:`~descentflow.surveillance.open_descents`
takes rows or prepared descents for every command, and :mod:`~descentflow.surveillance.figure_pages` shows what cleaning
kept.
"""
