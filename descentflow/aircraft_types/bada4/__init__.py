"""EUROCONTROL's BADA 4, versions 4.2 and 4.3: its XML files and its equations of a descent.

Reading order: :mod:`~descentflow.aircraft_types.bada4.bada4_directory` (a folder of files),
:mod:`~descentflow.aircraft_types.bada4.acm_file` (one file), and the model itself,
:mod:`~descentflow.aircraft_types.bada4.bada4_aircraft`, made of :mod:`~descentflow.aircraft_types.bada4.wing` and
:mod:`~descentflow.aircraft_types.bada4.engines`.

Ratings and speeds of climb and cruise are read and kept. They are not flown: only a simulated flight that levels off
asks for climb thrust.
"""
