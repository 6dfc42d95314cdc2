"""The command line: one module for each command, which parses arguments and calls the public functions.

Read :mod:`~descentflow.cli.entry` first. Nothing heavy is imported before a command needs it.
"""

from descentflow.cli.entry import main

__all__ = ["main"]
