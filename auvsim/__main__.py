"""`python -m auvsim`: the command without its installed script."""

import sys

from auvsim.cli import main

sys.exit(main())
