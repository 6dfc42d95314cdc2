"""Schema, units and names of surveillance rows, checks of their columns, and the report of dropped rows.

Reading order: :mod:`~descentflow.surveillance.rows.schema`, :mod:`~descentflow.surveillance.rows.normalise` (a table
in that schema, with :mod:`~descentflow.surveillance.rows.column_names`, :mod:`~descentflow.surveillance.rows.times` and
:mod:`~descentflow.surveillance.rows.addresses`), :mod:`~descentflow.surveillance.rows.units_check` (with
:mod:`~descentflow.surveillance.rows.readings` and :mod:`~descentflow.surveillance.rows.units_words`),
:mod:`~descentflow.surveillance.rows.values_beside`, :mod:`~descentflow.surveillance.rows.drop_report`,
:mod:`~descentflow.surveillance.rows.air_data`.
"""
