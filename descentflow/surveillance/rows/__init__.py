"""Schema, units and names of surveillance rows, checks of their columns, and the report of dropped rows.

Reading order: :mod:`~descentflow.surveillance.rows.schema`, ``_normalise`` (a table in that schema, with
``_column_names``, ``_times`` and ``_addresses``), ``_units_check`` (with ``_readings`` and ``_units_words``),
``_values_of_other_rows``, ``_placeholder_values``, :mod:`~descentflow.surveillance.rows.drop_report`,
:mod:`~descentflow.surveillance.rows.air_data`.
"""
