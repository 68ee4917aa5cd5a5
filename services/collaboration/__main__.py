"""`python -m services.collaboration` is `engage run collaboration`."""

import sys

from services.cli import main

main(["run", "collaboration", *sys.argv[1:]])
