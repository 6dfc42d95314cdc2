"""Descents that meet what a controller asks: speeds, a time or a place at a level, what was flown so far.

Reading order: :mod:`~descentflow.generation.conditional.generator` (what a user calls),
:mod:`~descentflow.generation.conditional.constraints` (what can be asked), ``_latent_density`` (the density as
Gaussians over the latent numbers), ``_speed_conditions`` (speeds, in closed form), ``_point_condition`` (a time or a
distance at a level, by importance resampling), ``_conditioned_density`` (both joined), ``_draws`` (draws, until they
are plausible), ``_nearest_plausible`` (the error where nothing is plausible).
"""
