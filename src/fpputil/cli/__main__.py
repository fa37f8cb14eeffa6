"""``python -m fpputil.cli``, for `torchrun` and where the command is not on the path."""

import sys

from fpputil.cli import main

sys.exit(main())
