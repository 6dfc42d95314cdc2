"""Descents that meet what a controller asks: speeds, a time or a place at a level, what was flown so far.

Reading order: :mod:`~descentflow.generation.conditional.generator` (what a user calls),
:mod:`~descentflow.generation.conditional.constraints` (what can be asked),
:mod:`~descentflow.generation.conditional.latent_density` (the density as Gaussians over the latent numbers),
:mod:`~descentflow.generation.conditional.speed_conditions` (speeds, in closed form),
:mod:`~descentflow.generation.conditional.point_condition` (a time or a distance at a level, by importance resampling),
:mod:`~descentflow.generation.conditional.conditioned_density` (both joined),
:mod:`~descentflow.generation.conditional.draws` (draws, until they are plausible),
:mod:`~descentflow.generation.conditional.nearest_plausible` (the error where nothing is plausible).
"""
