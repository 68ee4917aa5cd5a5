"""`python -m engage_hri.services.recognition` is `engage run recognition`."""

import sys

from engage_hri.services.__main__ import main

main(["run", "recognition", *sys.argv[1:]])
