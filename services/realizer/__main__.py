"""`python -m services.realizer` is `engage run realizer`."""

import sys

from services.cli import main

main(["run", "realizer", *sys.argv[1:]])
