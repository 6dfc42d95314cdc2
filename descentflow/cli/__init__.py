"""The command line: a function for each command, whose parameters are its options and which calls the public one.

Read :mod:`~descentflow.cli.entry` first, then :mod:`~descentflow.cli.options`.
Nothing heavy is imported before a command needs it.
"""

from descentflow.cli.entry import main

__all__ = ["main"]
