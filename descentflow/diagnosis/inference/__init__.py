"""Which effects explain the difference: likelihood, selection, uncertainty, tests by permutation.

Reading order: :mod:`~descentflow.diagnosis.inference.two_sides`,
:mod:`~descentflow.diagnosis.inference.whitening`, :mod:`~descentflow.diagnosis.inference.likelihood`,
:mod:`~descentflow.diagnosis.inference.signature_columns`, :mod:`~descentflow.diagnosis.inference.set_search`,
:mod:`~descentflow.diagnosis.inference.selection`.
"""
