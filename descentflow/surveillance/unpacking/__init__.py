"""Paths to streams of bytes: folders, split archives, gzip, tar archives and JSON documents, whatever rows they hold.

Reading order: :mod:`~descentflow.surveillance.unpacking.inputs` (the way from paths to streams),
:mod:`~descentflow.surveillance.unpacking.source_files`, :mod:`~descentflow.surveillance.unpacking.streams`,
:mod:`~descentflow.surveillance.unpacking.archives`, :mod:`~descentflow.surveillance.unpacking.json_documents`,
:mod:`~descentflow.surveillance.unpacking.unreadable`.
"""
