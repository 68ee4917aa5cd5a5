"""`python -m services.control` is `engage run control`."""

import sys

from services.cli import main

main(["run", "control", *sys.argv[1:]])
