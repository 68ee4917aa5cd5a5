"""Run a module on a clock that goes wrong: `python -m tests.lab.drifting SINCE RATE MODULE [ARGUMENT]...`.

The monotonic clock of that process goes by `1 + RATE`, and is right at the instant `SINCE`. So a laboratory whose
machines all run on one kernel has quartzes that drift apart.
"""

import runpy
import sys
import time


def main() -> None:
    since, rate = float(sys.argv[1]), float(sys.argv[2])
    true = time.monotonic
    time.monotonic = lambda: since + (true() - since) * (1.0 + rate)  # asyncio's loops read it by this name
    sys.argv = sys.argv[3:]
    runpy.run_module(sys.argv[0], run_name="__main__", alter_sys=True)


if __name__ == "__main__":
    main()
