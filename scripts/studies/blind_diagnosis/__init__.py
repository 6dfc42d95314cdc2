"""The diagnosis checked on effects that were hidden from it: sealed keys, blind sets, scores.

Reading order: :mod:`~studies.blind_diagnosis.blind_plan` (the key: what is planted where),
:mod:`~studies.blind_diagnosis.blind_worlds` and :mod:`~studies.blind_diagnosis.blind_draw` (how
it is drawn), :mod:`~studies.blind_diagnosis.blind_flights` and
:mod:`~studies.blind_diagnosis.seal` (flights and hashes),
:mod:`~studies.blind_diagnosis.blind_run` (generate, diagnose),
:mod:`~studies.blind_diagnosis.outcome`, :mod:`~studies.blind_diagnosis.true_sizes` and
:mod:`~studies.blind_diagnosis.study_score` (goals, misses and intervals).
"""
