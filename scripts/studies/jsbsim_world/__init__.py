"""Flights of JSBSim's aircraft in six degrees of freedom, under an autopilot of ours, reported as a radar would.

Equations of motion, aerodynamics, engines and atmosphere are JSBSim's and its models' (extra ``jsbsim``); of ours are
the autopilot, the effects that are injected and the radar. So `prepare` and `diagnose` can be tried on physics that
share nothing with the decoder.

Reading order: :mod:`~studies.jsbsim_world.fly_models`,
:mod:`~studies.jsbsim_world.airframes`, :mod:`~studies.jsbsim_world.model_files`,
:mod:`~studies.jsbsim_world.flight_plans`,
:mod:`~studies.jsbsim_world.model_effects`, :mod:`~studies.jsbsim_world.pitch_autopilot`,
:mod:`~studies.jsbsim_world.model_aircraft`,
:mod:`~studies.jsbsim_world.model_flight`.
"""
