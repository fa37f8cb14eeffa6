"""``python -m fpputil``, the command `fpp` where it is not on the path."""

import sys

from fpputil.cli import main

if __name__ == "__main__":
    sys.exit(main())
