"""Schema, units and names of surveillance rows, checks of their columns, and the report of dropped rows.

Reading order: :mod:`~descentflow.surveillance.rows.schema`, :mod:`~descentflow.surveillance.rows.normalise` (a table
of any source in that schema), :mod:`~descentflow.surveillance.rows.units_check` (with
:mod:`~descentflow.surveillance.rows.readings`, :mod:`~descentflow.surveillance.rows.rate_readings`,
:mod:`~descentflow.surveillance.rows.flight_ratios`, :mod:`~descentflow.surveillance.rows.units_words` and
:mod:`~descentflow.surveillance.rows.other_checks`), :mod:`~descentflow.surveillance.rows.relative_times`,
:mod:`~descentflow.surveillance.rows.addresses`, :mod:`~descentflow.surveillance.rows.types_table`,
:mod:`~descentflow.surveillance.rows.missing_columns`, :mod:`~descentflow.surveillance.rows.values_beside`,
:mod:`~descentflow.surveillance.rows.drop_report`, :mod:`~descentflow.surveillance.rows.air_data`.
"""
