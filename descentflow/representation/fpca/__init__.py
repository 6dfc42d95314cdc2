"""Functional principal component analysis of drag and of CAS from profiles with missing levels.

Reading order: :mod:`~descentflow.representation.fpca.gappy` (fit), :mod:`~descentflow.representation.fpca.basis` (what
a checkpoint keeps, and how many components), :mod:`~descentflow.representation.fpca.ppca` (probabilistic PCA),
``_iterative`` (the paper's own algorithm), :mod:`~descentflow.representation.fpca.roughness` (smoothness, and how far
extrapolated levels are trusted).
"""
