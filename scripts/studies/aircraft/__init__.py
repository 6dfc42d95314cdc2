"""Figures about aircraft types and the energy equation, for the documentation.

Read :mod:`~studies.aircraft.open_aircraft_figures`, then
:mod:`~studies.aircraft.energy_share_figure`.
"""
