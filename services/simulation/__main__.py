"""`python -m services.simulation` is `engage run simulation`."""

import sys

from services.cli import main

main(["run", "simulation", *sys.argv[1:]])
