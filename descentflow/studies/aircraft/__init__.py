"""Figures about aircraft types and the energy equation, for the documentation.

Read :mod:`~descentflow.studies.aircraft.open_aircraft_figures`, then
:mod:`~descentflow.studies.aircraft.energy_share_figure`.
"""
