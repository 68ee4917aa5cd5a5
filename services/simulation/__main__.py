"""`python -m engage_hri.services.simulation`: the same as `engage run simulation`."""

import sys

from engage_hri.services.__main__ import main

if __name__ == "__main__":
    sys.argv[1:1] = ["run", "simulation"]
    main()
