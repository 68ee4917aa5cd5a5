"""`python -m engage_hri.services.realizer` is `engage run realizer`."""

import sys

from engage_hri.services.__main__ import main

main(["run", "realizer", *sys.argv[1:]])
