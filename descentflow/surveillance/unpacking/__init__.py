"""Paths to streams of bytes: folders, split archives, gzip and tar archives, whatever rows they hold.

Reading order: :mod:`~descentflow.surveillance.unpacking.inputs` (from paths to streams),
:mod:`~descentflow.surveillance.unpacking.streams`.
"""
