"""Descents that meet what a controller asks: speeds, a time or a place at a level, what was flown so far.

Reading order: :mod:`~descentflow.generation.conditional.generator` (what a user calls),
:mod:`~descentflow.generation.conditional.constraints` (what can be asked),
:mod:`~descentflow.generation.conditional.latent_parts` (the density as Gaussians over the latent numbers),
:mod:`~descentflow.generation.conditional.speed_conditions` (speeds, in closed form),
:mod:`~descentflow.generation.conditional.point_condition` (a time or a distance at a level, by importance resampling)
with :mod:`~descentflow.generation.conditional.point_measure`,
:mod:`~descentflow.generation.conditional.conditioned_density` and
:mod:`~descentflow.generation.conditional.entry_shares` (both joined, with the law of samples),
:mod:`~descentflow.generation.conditional.latent_draws`,
:mod:`~descentflow.generation.conditional.judged_draws` and :mod:`~descentflow.generation.conditional.accepted` (draws,
until they are plausible),
:mod:`~descentflow.generation.conditional.flown_profiles` (the arithmetic of descents, the same bits in any batch),
:mod:`~descentflow.generation.conditional.nearest_plausible` (what is said where nothing is plausible).
"""
