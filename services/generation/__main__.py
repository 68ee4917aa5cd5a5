"""`python -m services.generation` is `engage run generation`."""

import sys

from services.cli import main

main(["run", "generation", *sys.argv[1:]])
