"""`python -m services.realizer` is `engage run realizer`."""

import sys

from services.__main__ import main

main(["run", "realizer", *sys.argv[1:]])
