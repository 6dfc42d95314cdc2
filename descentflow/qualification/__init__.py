"""Qualification of a simulator by limits: shares of flights inside, means with intervals, and a record to sign.

Read :mod:`~descentflow.qualification.qualify` first. Limits are in :mod:`~descentflow.qualification.limits`, what
flights deviate by in :mod:`~descentflow.qualification.deviations`, and the tests of equivalence in
:mod:`~descentflow.qualification.equivalence`.
"""
