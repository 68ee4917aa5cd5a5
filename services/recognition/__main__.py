"""`python -m services.recognition` is `engage run recognition`."""

import sys

from services.__main__ import main

main(["run", "recognition", *sys.argv[1:]])
