"""The equations of descent: atmosphere, airspeeds, forces and BADA 3's total-energy equation.

Reading order: :mod:`~descentflow.physics.atmosphere`, :mod:`~descentflow.physics.airspeed`,
:mod:`~descentflow.physics.forces`, :mod:`~descentflow.physics.energy`, :mod:`~descentflow.physics.nominal_descent`.
"""
