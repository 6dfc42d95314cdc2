"""EUROCONTROL's BADA 3 files: OPF, APF, GPF and SYNONYM.NEW, read and written as they are shipped.

Read :mod:`~descentflow.aircraft_types.bada3.bada_directory` (a folder of files) first, then a file format.
"""
