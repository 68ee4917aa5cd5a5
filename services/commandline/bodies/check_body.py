"""Command `engage check-body`: hold a body to the contract of bodies, and say what to do where it breaks it."""

import math
import sys
from collections.abc import Callable
from contextlib import redirect_stdout
from dataclasses import dataclass
from functools import partial
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from msgspec.structs import replace

from engage_hri.schemas.faults import Fault, InputRefused
from engage_hri.services.commandline.shell.options import Configured
from engage_hri.services.commandline.shell.outputs import Terminal, print_format
from engage_hri.services.commandline.shell.process import DONE, end_like_ctrl_c
from engage_hri.services.commandline.shell.sources import read_world
from engage_hri.services.runtime.installation import extra_command

if TYPE_CHECKING:
    from engage_hri.services.control.config import ControlConfig
    from engage_hri.services.control.contract.body import Body

BROKEN = 1
"""Exit code if a law is broken, or none could be checked."""
NEEDED = ("pytest", "pytest_asyncio")


@dataclass(frozen=True, kw_only=True)
class Options(Configured):
    body: Annotated[str, typer.Argument(metavar="BODY", help="FILE.py:CLASS, package.module:CLASS, or a name.")]
    real_time: Annotated[
        bool, typer.Option("--real-time", help="The body has a clock of its own: hardware, or a daemon.")
    ] = False
    tolerance: Annotated[
        float, typer.Option(metavar="SECONDS", min=0.0, help="Stated error of its estimates, from point to point.")
    ] = 0.1
    noise: Annotated[
        float, typer.Option(metavar="DEGREES", min=0.0, help="Stated scatter of its encoders, a standard deviation.")
    ] = 0.0
    accuracy: Annotated[
        float, typer.Option(metavar="DEGREES", min=0.0, help="How near joints and eyes come to where they are to be.")
    ] = 1.0
    world: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="JSON of the entities that it looks at; without it a table and a person."),
    ] = None
    law: Annotated[
        str, typer.Option(metavar="WORDS", help="Only laws with these words in their names.", show_default=False)
    ] = ""
    json: Annotated[bool, typer.Option("--json", help="The whole report as one JSON object.")] = False


def main(options: Options) -> int:
    """Check. Exit 1 if a law is broken, 2 if there is no such body, 3 if it cannot be connected.

    Raises KeyboardInterrupt if it was stopped, once it has printed what was judged so far.
    """
    if missing := [name for name in NEEDED if find_spec(name) is None]:
        reason = f"check-body needs {' and '.join(missing).replace('_', '-')}"
        raise InputRefused(Fault(reason=reason, advice=extra_command("check")))
    from engage_hri.services.control.testing.check import check
    from engage_hri.services.control.testing.report import Printed, Stated, as_json

    stated = Stated(
        tolerance=options.tolerance, noise=math.radians(options.noise), accuracy=math.radians(options.accuracy),
        real_time=options.real_time, world=read_world(options.world) if options.world else None,
    )  # fmt: skip
    end_like_ctrl_c()
    printed = None if options.json else Printed(Terminal(highlight=False, file=sys.stdout))
    with redirect_stdout(sys.stderr):  # what a driver prints is no part of the report
        make = maker(options.body, options.load().control)
        report = check(make, stated, driver=options.body, law=options.law, printed=printed)
    if printed is None:
        print_format(as_json(report))
    else:
        printed.end(report)
    if report.is_stopped:
        raise KeyboardInterrupt
    return DONE if report.is_good else BROKEN


def maker(name: str, config: "ControlConfig") -> "Callable[[], Body]":
    """Find a driver, and say how its body is made. Raises InputRefused."""
    from engage_hri.services.control.bases import drivers

    asked = replace(config, body=name)
    drivers.check(asked)
    return partial(drivers.made, asked, is_guarded=False)
