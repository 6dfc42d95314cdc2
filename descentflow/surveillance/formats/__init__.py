"""Sources of surveillance rows: one file per format, and the table of formats that a new source is entered in.

Reading order: :mod:`~descentflow.surveillance.formats.known_formats` (the table),
:mod:`~descentflow.surveillance.formats.file_format` (what a format is),
:mod:`~descentflow.surveillance.formats.recognition` (which format a file has), then any format
(:mod:`~descentflow.surveillance.formats.aircraft_json` is a simple one).
"""
