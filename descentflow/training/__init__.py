"""Fitting: the DataModule, a LightningModule for each density, callbacks, and :func:`~descentflow.training.fit.fit`.

Reading order: :mod:`~descentflow.training.fit` (the whole way), :mod:`~descentflow.training.training_settings` (the
YAML files), :mod:`~descentflow.training.datamodule` (descents to standardised weights, with
:mod:`~descentflow.training.splitting`), :mod:`~descentflow.training.models` (what fits each density),
:mod:`~descentflow.training.callbacks` (scores while a model trains, log densities of flights).

To add a model: a density in :mod:`descentflow.densities`, a LightningModule that fits it in
:mod:`descentflow.training.models` (both say how), and a settings file in ``descentflow/configs/model/``, entered in
``NAMES`` and ``SETTINGS_OF`` of :mod:`~descentflow.training.training_settings`, so that ``fit`` knows it by name.
"""
