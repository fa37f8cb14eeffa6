"""``python -m fpputil``, the command `fpp` where it is not on the path."""

import sys

from fpputil.cli import main

sys.exit(main())
