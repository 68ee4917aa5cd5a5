"""Command line: the table of all commands, each a file in the folder of its family.

The file of a command `X-Y` is `X_Y.py`, with its `Options` and its `main`. It is loaded when its command is called:
the list of all commands needs only the table here.
"""

import gc
import inspect
import sys
from importlib import import_module
from io import TextIOWrapper
from math import isnan
from typing import Annotated, Any, NoReturn

import typer
from typer.core import TyperGroup

from engage_hri.schemas.faults import Fault, InputRefused
from engage_hri.services.commandline.shell import logs
from engage_hri.services.commandline.shell.process import exit_code
from engage_hri.services.runtime.installation import extra_command

FAMILIES: dict[str, dict[str, str]] = {
    "look": {
        "demo": "Watch a robot and a person make a tangram: everything in this one process.",
        "talk": "Talk with a robot: voice, ears and a manager of a few rules, in the browser or on devices.",
        "watch": "Follow a running system: connection events, the open ones first, feedback, claims on the head, "
        "as they come.",
        "console": "Show a running robot in the browser: the scene in 3D, lanes of events and behaviors, the "
        "Petri net.",
    },
    "robot": {
        "up": "Run the services as separate processes on this machine; Ctrl-C stops them all.",
        "run": "Run one service, on whatever machine this is, until Ctrl-C.",
        "router": "Pass on what the processes of several machines send one another, until Ctrl-C.",
        "keys": "Make certificates for all that take part (init, add, renew, revoke), show when they expire "
        "(show), and print the rules of who may do what (acl).",
        "eyes": "Fetch the models by which eyes find faces, from PyPI or a folder (eyes install).",
        "hearing": "Fetch the model by which hearing knows how turns end, from PyPI or a folder (hearing install).",
        "check-perception": "Hold a source of head poses to its laws, and tell where it breaks which. Exit 1 if it "
        "breaks one.",
        "doctor": "Tell who sees whom, what is wrong, and what to do. Exit 1 if something is wrong.",
    },
    "talk": {
        "play": "Perform turn fragments and BML blocks. Exit 0 done, 2 input refused, 3 failed while running.",
        "steer": "Hold what a running robot performs, let it continue, or stop it; begin a condition of a study. "
        "Exit 2 if it is not being performed.",
        "plan": "Check a block and print its Petri net and predicted schedule, or why its references are made so. "
        "Nothing moves.",
        "bml": "Print the BML that a turn fragment becomes, or a block in another dialect. Nothing moves.",
        "check-recognizer": "Let a recognizer of speech hear spoken files, and tell its errors, delay and processor "
        "time.",
        "tool": "Print the tool by which a language model speaks through the robot, for its API.",
    },
    "study": {
        "simulate": "Play many sessions in virtual time, and compare the conditions of the study. Exit 3 if one "
        "did not finish.",
        "record": "Record all that a robot says on its bus into a file (MCAP), until Ctrl-C.",
        "replay": "Play a recording on a bus, at any speed, to and fro. Exit 75 if a live robot of its name is "
        "there.",
        "export": "Turn a recording into annotations (ELAN, CSV), lines, or the settings of its services.",
        "analyse": "Make the tables of a study of recordings of people, or recognize them once more (--again).",
        "session": "",
    },
    "bodies": {
        "new-body": "Write a file with the driver of a robot that takes set points, to go on from.",
        "check-body": "Hold a body to the contract of bodies, and tell where it breaks which. Exit 1 if it breaks"
        " one.",
        "calibrate": "Measure where a body really looks and points (calibrate body), where a camera stands (eyes, "
        "pieces), or the colors of pieces (colors), and write a file. Exit 2 if nobody sees where it points.",
        "fault": "Switch faults of a running robot's simulated body on and off, or list what it can play. Exit 2 "
        "if it cannot play them.",
    },
}
"""Commands with their help, by folder. One without help is for our own child processes."""
TITLES = {
    "look": "Look at a robot",
    "robot": "Run a robot",
    "talk": "Make it talk",
    "study": "Studies and recordings",
    "bodies": "Bodies",
}
"""Headings of the folders in the list of all commands."""
COMMANDS = {name: does for commands in FAMILIES.values() for name, does in commands.items()}
TANGRAM = "engage_hri.services.tangram"
_FOLDER = {name: folder for folder, commands in FAMILIES.items() for name in commands}


def command(name: str) -> Any:
    """Load a command from its file. Its own options come first, then the shared ones.

    Raises InputRefused if it needs the tangram, and that is not installed.
    """
    try:
        module = import_module(f"engage_hri.services.commandline.{_FOLDER[name]}.{name.replace('-', '_')}")
    except ModuleNotFoundError as error:
        if not (error.name or "").startswith(TANGRAM):
            raise
        raise InputRefused(
            Fault(reason="it needs the tangram", where=f"engage {name}", advice=extra_command("tangram"))
        ) from error
    taken = inspect.signature(module.Options).parameters
    kinds = module.Options.__mro__  # a command may have another default for an option that it shares
    names = dict.fromkeys(option for kind in kinds for option in inspect.get_annotations(kind))

    def run(**given: Any) -> None:
        # Other commands show faults themselves, as they come on the bus.
        logs.configure(given.get("log"), given.get("log_level") or (), alerts=name in ("run", "up"))
        if not gc.isenabled():  # `services/__main__.py` has switched it off; what has been loaded stays
            gc.freeze()
            gc.enable()
        for option, value in given.items():
            if isinstance(value, float) and isnan(value):  # it is within all bounds, as Typer compares
                raise InputRefused(Fault(reason="nan is not a number", where=f"--{option.replace('_', '-')}"))
        raise typer.Exit(module.main(module.Options(**given)))

    run.__signature__ = inspect.Signature([taken[option] for option in names])  # type: ignore[attr-defined]
    alone = typer.Typer(add_completion=False, pretty_exceptions_enable=False)
    alone.command(name, help=COMMANDS[name])(run)
    made = typer.main.get_command(alone)
    for option in made.params:
        if getattr(option, "is_flag", False):
            option.metavar = ""  # else the help calls it `<bool>`
    return made


class Commands(TyperGroup):
    """Group of commands that loads a command when it is called."""

    def resolve_command(self, context: Any, arguments: list[str]) -> Any:
        name, listed, rest = super().resolve_command(context, arguments)
        return name, listed and command(str(listed.name)), rest


def _listed() -> None:
    """Stand for a command in the list of all commands."""


app = typer.Typer(
    name="engage",
    cls=Commands,
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)
for _name, _help in COMMANDS.items():
    app.command(_name, help=_help, hidden=not _help, rich_help_panel=TITLES[_FOLDER[_name]])(_listed)


def _print_version(asked: bool) -> None:
    if asked:
        from engage_hri.services.runtime.service import installed_version

        print(f"engage {installed_version()}")
        raise typer.Exit


@app.callback()
def engage(
    version: Annotated[
        bool, typer.Option("--version", metavar="", callback=_print_version, is_eager=True, help="Print the version.")
    ] = False,
) -> None:
    """The engagement layer for robots that talk with people."""


def main(arguments: list[str] | None = None) -> NoReturn:
    """Run a command. Bad input is one line on standard error, never a traceback; a bug of ours is a traceback."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")  # a terminal that knows no arrows still gets the rest
    sys.exit(exit_code(app, arguments))
