"""From the rows of an aircraft to free descents on flight levels: filters in order, and their thresholds.

Reading order: :mod:`~descentflow.surveillance.cleaning.thresholds` (every threshold, with its source),
:mod:`~descentflow.surveillance.cleaning.chain` (the filters in their order), ``_flights``, ``_two_clocks``,
:mod:`~descentflow.surveillance.cleaning.filters` (a filter), ``_faulty_values``,
:mod:`~descentflow.surveillance.cleaning.rates`, ``_descent_filters``, ``_level_grid`` and
:mod:`~descentflow.surveillance.cleaning.drop_report_checks`.
"""
