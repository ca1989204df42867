"""`python -m agents.cli` is `shotenv`."""

import sys

from agents.cli.entry import main

sys.exit(main())
