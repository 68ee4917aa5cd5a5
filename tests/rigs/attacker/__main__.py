"""Attack a robot with each role and each attack, beside a manager who performs: `python -m tests.rigs.attacker`.

Prints a table. Exit 1 if an attack costs a fragment, a restart or 150 MB of the router, or a second and a half.
"""

import argparse
import asyncio
import sys
import time
from pathlib import Path
from tempfile import TemporaryDirectory

from tests.rigs.attacker.attacks import ATTACKS
from tests.rigs.attacker.trial import HOLDERS, Siege, attacked

MOST_MEMORY = 150.0
"""Megabytes of a router that is attacked."""
SLOWER = 1.5
"""Seconds by which the slowest fragment may take longer than in calm."""
TOLD = 160
"""Letters of what was told that are shown."""


def parser() -> argparse.ArgumentParser:
    made = argparse.ArgumentParser(prog="python -m tests.rigs.attacker", description=__doc__, allow_abbrev=False)
    made.add_argument("--seconds", type=float, default=12.0, help="how long each attack lasts")
    made.add_argument("--role", choices=HOLDERS, action="append", help="repeatable; else all")
    made.add_argument("--attack", choices=ATTACKS, action="append", help="repeatable; else all")
    made.add_argument("--open", action="store_true", help="a robot without keys")
    return made


async def trial(options: argparse.Namespace) -> int:
    is_wrong = False
    with TemporaryDirectory() as folder, Siege(Path(folder), has_keys=not options.open) as siege:
        async with siege.manager() as robot:
            calm = await siege.perform(robot, time.monotonic() + options.seconds)
            print(f"calm: {len(calm.seconds)} done, slowest {calm.slowest:.2f} s, router {siege.memory():.0f} MB")
            print("| by | attack | times | links lost | done | lost | slowest s | router MB | told |", flush=True)
            print("|---|---|---|---|---|---|---|---|---|")
            for role in options.role or HOLDERS:
                for attack in options.attack or ATTACKS:
                    one = await attacked(siege, robot, role, attack, options.seconds)
                    done, lost = len(one.performed.seconds), one.performed.lost
                    slow = one.performed.slowest
                    wrong = (
                        bool(lost)
                        or one.memory > MOST_MEMORY
                        or slow > calm.slowest + SLOWER
                        or not done
                        or one.restarts > 0
                    )
                    is_wrong |= wrong
                    told = one.told[0][:TOLD] if one.told else ""
                    print(
                        f"| {role} | {attack} | {one.times} | {one.refused} | {done} | {len(lost)} | {slow:.2f} |"
                        f" {one.memory:.0f} | {told} |{' WRONG' if wrong else ''}",
                        flush=True,
                    )
                    for each in (*lost, *(line for line in siege.router.lines if "started anew" in line)):
                        print(f"    {each}")
    return int(is_wrong)


if __name__ == "__main__":
    sys.exit(asyncio.run(trial(parser().parse_args())))
