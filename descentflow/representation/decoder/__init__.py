"""From weights to trajectories: drag and CAS, then batched total-energy integration.

Read :mod:`~descentflow.representation.decoder.descent_decoder`, then
:mod:`~descentflow.representation.decoder.trajectories`.
"""
