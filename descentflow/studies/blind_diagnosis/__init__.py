"""The diagnosis checked on effects that were hidden from it: sealed keys, blind sets, scores.

Read :mod:`~descentflow.studies.blind_diagnosis.blind_plan`, then :mod:`~descentflow.studies.blind_diagnosis.blind_run`.
"""
