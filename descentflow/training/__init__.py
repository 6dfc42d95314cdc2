"""Fitting: the DataModule, a LightningModule for each density, callbacks, and :func:`~descentflow.training.fit.fit`.

Reading order: :mod:`~descentflow.training.datamodule`, :mod:`~descentflow.training.models`,
:mod:`~descentflow.training.fit`.
"""
