"""Flights as a model sees them: profiles, principal components, weights, and the decoder that flies weights again.

A *weight* is the coordinate of a flight along a functional principal component (its fPCA score).

Reading order: :mod:`~descentflow.representation.profiles` (drag and CAS on flight levels),
:mod:`~descentflow.representation.drag_scale` (the scale on which drag is linear in the weights),
:mod:`~descentflow.representation.fpca` (principal components), :mod:`~descentflow.representation.decoder` (weights to
trajectories), :mod:`~descentflow.representation.context` (temperature, operator and the like as numbers),
:mod:`~descentflow.representation.plausibility` (bounds), :mod:`~descentflow.representation.representation` (all of
them), :mod:`~descentflow.representation.read_checkpoint` (reading them from a file).
"""
