"""Sources of surveillance rows: files and archives, told apart by content, read as blocks of rows.

Read :mod:`~descentflow.surveillance.formats.readers`, then :mod:`~descentflow.surveillance.formats.detection`.
"""
