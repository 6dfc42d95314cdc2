"""EUROCONTROL's BADA 3 files: OPF, APF, GPF and SYNONYM.NEW, read and written as they are shipped.

Reading order: ``_bada_directory`` (a folder of files), then a file format:
:mod:`~descentflow.aircraft_types.bada3.opf_file` or :mod:`~descentflow.aircraft_types.bada3.apf_file`, both on
``_fixed_columns``.
"""
