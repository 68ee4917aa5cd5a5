"""`python -m engage_hri.services.control` is `engage run control`."""

import sys

from engage_hri.services.__main__ import main

main(["run", "control", *sys.argv[1:]])
