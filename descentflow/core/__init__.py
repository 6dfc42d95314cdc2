"""What every other package stands on: errors, units, constants, whole files, workers and threads.

Nothing here knows of aircraft or flights. Read :mod:`~descentflow.core.errors` and :mod:`~descentflow.core.units`
first.
"""
