"""Watch over a simulator: days of real flights as they come, an alarm when their difference from it changes.

Read :mod:`~descentflow.watching.watch` first. The evidence is in :mod:`~descentflow.watching.change_evidence`, the
record of a day in :mod:`~descentflow.watching.day_record`, and the folder between runs in
:mod:`~descentflow.watching.state`.
"""
