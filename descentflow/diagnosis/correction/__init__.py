"""Effects put into flights, and the simulator with them.

Reading order: :mod:`~descentflow.diagnosis.correction.effects_in_flights` and ``_flight_gaps`` (effects put into
flights), :mod:`~descentflow.diagnosis.correction.corrected_descents` and ``_corrected_simulator`` (the simulator with
them).
"""
