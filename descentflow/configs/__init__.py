"""Settings that come with the package, as YAML: models, the quickstart's experiment, the cleaning of rows.

Read :mod:`~descentflow.configs.packaged_config`, which finds them by name.
"""
