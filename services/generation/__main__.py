"""`python -m services.generation` is `engage run generation`."""

import sys

from services.__main__ import main

main(["run", "generation", *sys.argv[1:]])
