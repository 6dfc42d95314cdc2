"""From the rows of an aircraft to free descents on flight levels: filters in order, and their thresholds.

Reading order: :mod:`~descentflow.surveillance.cleaning.thresholds` (every threshold, with its source),
:mod:`~descentflow.surveillance.cleaning.chain` (the filters in their order),
:mod:`~descentflow.surveillance.cleaning.flights`, :mod:`~descentflow.surveillance.cleaning.two_clocks`,
:mod:`~descentflow.surveillance.cleaning.filters` (a filter), :mod:`~descentflow.surveillance.cleaning.faulty_values`,
:mod:`~descentflow.surveillance.cleaning.rates`, :mod:`~descentflow.surveillance.cleaning.descent_filters`,
:mod:`~descentflow.surveillance.cleaning.level_grid` and :mod:`~descentflow.surveillance.cleaning.report_checks`.
"""
