"""Kill a process of a robot again and again, and judge what became of what was asked meanwhile.

Exit 1 if anything hung, was lost or came twice.
"""

import argparse
import asyncio
import json
import random
import sys

from tests.rigs.kills.trial import trial


def main(arguments: list[str]) -> int:
    parser = argparse.ArgumentParser(prog="python -m tests.rigs.kills", description=__doc__)
    parser.add_argument("--kills", type=int, default=60)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--together", default="realizer,control", help="services of the process that is killed")
    options = parser.parse_args(arguments)
    verdict = asyncio.run(trial(options.together, options.kills, random.Random(options.seed)))
    print(json.dumps(verdict.told))
    return 1 if verdict.mistakes else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
