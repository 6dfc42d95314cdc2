"""Base of every other package, which knows nothing of aircraft or flights.

Reading order: :mod:`~descentflow.core.errors`, :mod:`~descentflow.core.units`, :mod:`~descentflow.core.constants` (of
the standard atmosphere), :mod:`~descentflow.core.tensors`, :mod:`~descentflow.core.files` (written whole or not at
all), :mod:`~descentflow.core.user_files`, :mod:`~descentflow.core.counter_random`,
:mod:`~descentflow.core.linear_gaussian`, :mod:`~descentflow.core.workers`, :mod:`~descentflow.core.threads`.
"""
