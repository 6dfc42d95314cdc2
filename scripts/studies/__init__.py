"""Whole studies over the public functions, each with its figures and its page.

:mod:`~studies.paper` repeats the paper's comparison of densities on thirteen types,
:mod:`~studies.blind_diagnosis` hides effects from the diagnosis and scores what it finds, and
:mod:`~studies.aircraft` draws the aircraft types. Programs that run them are in ``scripts/``;
:mod:`~studies.jsbsim_world` flies the aircraft of another program for them. Nothing of it is in the wheel.
"""
