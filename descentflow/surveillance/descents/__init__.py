"""Prepared descents: the table with its description, written to and read from a file or a store.

Reading order: :mod:`~descentflow.surveillance.descents.prepared_descents` (the result of `prepare`),
``_check_descents``, :mod:`~descentflow.surveillance.descents.store` (files and folders of files by type).
"""
