"""`python -m descentflow` is the command `descentflow`."""

import sys

from descentflow.cli.entry import main

if __name__ == "__main__":
    sys.exit(main())
