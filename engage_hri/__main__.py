"""`python -m engage_hri` is the command `engage`."""

import sys

from engage_hri.services.__main__ import main

main(sys.argv[1:])
