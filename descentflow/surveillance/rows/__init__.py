"""What a surveillance row is: its schema, units and names, and the report of dropped rows.

Reading order: :mod:`~descentflow.surveillance.rows.schema`, :mod:`~descentflow.surveillance.rows.normalise` (a table
of any source in that schema), :mod:`~descentflow.surveillance.rows.units_check`,
:mod:`~descentflow.surveillance.rows.blocks`, :mod:`~descentflow.surveillance.rows.drop_report`,
:mod:`~descentflow.surveillance.rows.air_data`.
"""
