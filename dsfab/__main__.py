"""Run the command line with `python -m dsfab`."""

import sys

from dsfab.app.cli import main

if __name__ == "__main__":
    sys.exit(main())
