"""`python -m services.control` is `engage run control`."""

import sys

from services.__main__ import main

main(["run", "control", *sys.argv[1:]])
