"""Sources of surveillance rows: one file per format, and the table of formats that a new source is entered in.

Reading order: ``_known_formats`` (what a format is, the table, and which format a file has), then any format
(:mod:`~descentflow.surveillance.formats.aircraft_json` is a simple one).
"""
