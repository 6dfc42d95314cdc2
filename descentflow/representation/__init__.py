"""What a flight is to a model: profiles, components, weights, and the decoder that flies weights again.

Reading order: :mod:`~descentflow.representation.profiles` (drag and CAS on flight levels),
:mod:`~descentflow.representation.fpca` (components), :mod:`~descentflow.representation.decoder` (weights to
trajectories),
:mod:`~descentflow.representation.plausibility` (bounds), :mod:`~descentflow.representation.representation` (all of
them), :mod:`~descentflow.representation.checkpoint` (reading them from a file).
"""
