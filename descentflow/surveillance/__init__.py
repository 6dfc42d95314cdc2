"""From surveillance rows to free descents; every row that is dropped is counted.

Reading order: :mod:`~descentflow.surveillance.prepare` (the whole path), then its stages:
:mod:`~descentflow.surveillance.formats` (sources to blocks of rows), :mod:`~descentflow.surveillance.rows` (what a
row is),
:mod:`~descentflow.surveillance.cleaning` (flights, filters, levels), :mod:`~descentflow.surveillance.out_of_core`
(rows that do not fit in memory), :mod:`~descentflow.surveillance.descents` (the result).
"""
