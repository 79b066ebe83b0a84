"""`python -m dsfab` runs the command line, also if the script `dsfab` is not on the path."""

import sys

from dsfab.app.cli import main

if __name__ == "__main__":
    sys.exit(main())
