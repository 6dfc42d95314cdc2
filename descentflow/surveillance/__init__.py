"""From surveillance rows to free descents; every row that is dropped is counted.

Reading order: :mod:`~descentflow.surveillance.prepare` (the whole way) and
:mod:`~descentflow.surveillance.read_rows` (a row's way through reading), then the folders along that way:
:mod:`~descentflow.surveillance.unpacking` (paths to streams of bytes),
:mod:`~descentflow.surveillance.formats` (streams to tables; a source of rows is added here),
:mod:`~descentflow.surveillance.rows` (tables to rows in one schema),
:mod:`~descentflow.surveillance.cleaning` (rows to free descents on flight levels; thresholds are changed here),
:mod:`~descentflow.surveillance.out_of_core` (rows that do not fit in memory),
:mod:`~descentflow.surveillance.descents` (the result), :mod:`~descentflow.surveillance.figures` (what cleaning kept).
"""
