"""The diagnosis checked on effects that were hidden from it: sealed keys, blind sets, scores.

Reading order: :mod:`~descentflow.studies.blind_diagnosis.blind_plan` (the key: what is planted where),
:mod:`~descentflow.studies.blind_diagnosis.blind_worlds` and :mod:`~descentflow.studies.blind_diagnosis.blind_draw` (how
it is drawn), :mod:`~descentflow.studies.blind_diagnosis.blind_flights` and
:mod:`~descentflow.studies.blind_diagnosis.seal` (flights and hashes),
:mod:`~descentflow.studies.blind_diagnosis.blind_run` (generate, diagnose),
:mod:`~descentflow.studies.blind_diagnosis.outcome`, :mod:`~descentflow.studies.blind_diagnosis.true_sizes`,
:mod:`~descentflow.studies.blind_diagnosis.score_tables`, :mod:`~descentflow.studies.blind_diagnosis.blind_score`,
:mod:`~descentflow.studies.blind_diagnosis.goals` and :mod:`~descentflow.studies.blind_diagnosis.blind_page` (what was
found), :mod:`~descentflow.studies.blind_diagnosis.study_evidence` (what is kept of a study, and several as one).
:mod:`~descentflow.studies.blind_diagnosis.real_flights` withholds a channel from real flights instead.
"""
