"""Seeded attacks on the whole robot, in this process and in virtual time: `python -m tests.rigs.hostile`.

Exit 1 after an attack with a consequence that must not be.
"""

import argparse
import json
import sys
from collections import Counter
from functools import partial

from engage_hri.services.commandline.shell.config import load
from engage_hri.services.control.bases.drivers import made
from tests.rigs.hostile.attacks import attack
from tests.rigs.hostile.trial import KINDS, Report

MISTAKES = (
    "services that ended", "services without status", "requests without outcome", "requests with two outcomes",
    "pending afterwards", "still spoken of", "tasks left", "contained failures", "clients that failed",
)  # fmt: skip


def main(arguments: list[str]) -> int:
    options = parser().parse_args(arguments)
    settings = [*options.set, *([f"control.body={json.dumps([options.body])}"] if options.body else [])]
    config = load(settings=settings)
    make = partial(made, config.control, is_guarded=False) if options.body else None
    kinds = tuple(kind for kind in KINDS if kind in (options.only or KINDS))
    counts: Counter[str] = Counter()
    is_wrong = False
    for seed in range(options.seed, options.seed + options.runs):
        report = attack(seed, config, seconds=options.seconds, kinds=kinds, body=make)
        counts.update(report.counts)
        if report.wrong:
            is_wrong = True
            tell(report, options)
    print(f"{options.runs} attacks")
    for what in (*sorted(set(counts) - set(MISTAKES)), *MISTAKES):
        print(f"  {counts[what]:8} {what}")
    return int(is_wrong)


def parser() -> argparse.ArgumentParser:
    made = argparse.ArgumentParser(prog="python -m tests.rigs.hostile", description=__doc__, allow_abbrev=False)
    made.add_argument("--runs", type=int, default=20, help="attacks, each with the next seed")
    made.add_argument("--seed", type=int, default=0, help="of the first")
    made.add_argument("--seconds", type=float, default=20.0, help="how long each lasts, in its own time")
    made.add_argument("--only", choices=KINDS, action="append", help="repeatable; else all three")
    made.add_argument("--body", help="one of yours, behind the real control, in place of one that lies")
    made.add_argument("--set", action="append", default=[], metavar="KEY=VALUE", help="a setting of the robot")
    return made


def tell(report: Report, options: argparse.Namespace) -> None:
    """Print what went wrong, and the command that does it again."""
    given = {"--only": options.only or (), "--body": filter(None, [options.body]), "--set": options.set}
    more = "".join(f" {option} {value}" for option, values in given.items() for value in values)
    again = f"--seed {report.attack.seed} --runs 1 --seconds {options.seconds:g}{more}"
    print(f"seed {report.attack.seed}: python -m tests.rigs.hostile {again}")
    for line in (*(f"  {each}" for each in report.wrong), *report.failures[:1]):
        print(line)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
