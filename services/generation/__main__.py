"""`python -m engage_hri.services.generation` is `engage run generation`."""

import sys

from engage_hri.services.__main__ import main

main(["run", "generation", *sys.argv[1:]])
