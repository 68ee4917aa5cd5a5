"""Command `engage doctor`: who sees whom, what is wrong on a robot's bus and on this machine, and what to do."""

import signal
from dataclasses import dataclass
from typing import Annotated

import typer

from engage_hri.services.bus.config import BusConfig
from engage_hri.services.commandline.shell.options import Connected
from engage_hri.services.commandline.shell.outputs import Terminal, print_format
from engage_hri.services.commandline.shell.process import DONE, run
from engage_hri.services.doctor.findings import findings
from engage_hri.services.doctor.report import as_json, report

LONGEST = 30
"""Seconds after which it is given up, should all bounds of single questions fail."""
WRONG = 1
"""Exit code if something is wrong."""


@dataclass(frozen=True, kw_only=True)
class Options(Connected):
    json: Annotated[bool, typer.Option("--json", help="Facts, matrix and findings as one JSON object.")] = False


def main(options: Options) -> int:
    """Examine once. Exit 1 if something is wrong."""
    config = options.load()
    signal.alarm(LONGEST)  # ends the process even where Zenoh stands still
    try:
        return run(_examine(config.bus, options.json))
    finally:
        signal.alarm(0)


async def _examine(bus: BusConfig, is_json: bool) -> int:
    from engage_hri.services.doctor.service import examining

    async with examining(bus) as facts:
        found = findings(facts)
        if is_json:
            print_format(as_json(facts, found))
        else:
            console = Terminal(highlight=False)
            console.print(report(facts, found, console.width))
    return WRONG if any(finding.severity == "wrong" for finding in found) else DONE
