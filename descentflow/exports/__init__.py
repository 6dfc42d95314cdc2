"""Samples and models in the formats of other programs: `descentflow export CKPT --to TARGET --out PATH`.

Reading order: :mod:`~descentflow.exports.targets` (which there are), :mod:`~descentflow.exports.export` (what a user
calls), :mod:`~descentflow.exports.export_request` (what a target is given), then a file each, ``..._export.py``. To add
a target, write such a file with a function ``write`` and enter it in ``targets.py``.
"""
