"""python -m hullguard."""

import sys

from hullguard.cli import main

sys.exit(main())
