"""Command line: a command `X-Y` is the file `X_Y.py` beside this one, with its `Options` and its `main`.

The file is loaded when its command is called. The list of all commands needs only the table here.
"""

import shutil
import sys
import textwrap
from collections.abc import Sequence
from functools import partial
from importlib import import_module
from io import TextIOWrapper
from typing import Any, NoReturn

from engage_hri.services.commandline import arguments
from engage_hri.services.commandline.ends import exit_code
from engage_hri.services.commandline.process import DONE, REFUSED

COMMANDS = {
    "demo": "Watch a robot and a person make a tangram: everything in this one process.",
    "up": "Run the services as separate processes on this machine; Ctrl-C stops them all.",
    "run": "Run one service, on whatever machine this is, until Ctrl-C.",
    "play": "Perform turn fragments and BML blocks. Exit 0 done, 2 input refused, 3 failed while running.",
    "plan": "Check a block and print its Petri net and predicted schedule. Nothing moves.",
    "bml": "Print the BML that a turn fragment becomes, or a block in another dialect. Nothing moves.",
    "explain": "Tell why each object reference is made as it is: all gestures with all phrases. Nothing moves.",
    "tool": "Print the tool by which a language model speaks through the robot, for its API.",
    "simulate": "Play many sessions in virtual time, and compare the conditions of the study. "
    "Exit 3 if one did not finish.",
    "watch": "Follow a running system: connection events, the open ones first, feedback, claims on the head, "
    "as they come.",
    "steer": "Hold what a running robot performs, let it continue, or stop it: a behavior, a block, or everything. "
    "Exit 2 if it is not being performed.",
    "fault": "Switch faults of a running robot's simulated body on and off, or list what it can play. "
    "Exit 2 if it cannot play them.",
    "calibrate": "Measure where a body really looks and points, and write a file that corrects it (calibrate body). "
    "Exit 2 if nobody sees where it points.",
    "hostile": "Attack the whole robot, in memory and virtual time only. "
    "Exit 1 if anything came of it that should not have.",
    "router": "Pass on what the processes of several machines send one another, until Ctrl-C.",
    "check-body": "Hold a body to the contract of bodies, and tell where it breaks which. Exit 1 if it breaks one.",
    "doctor": "Tell who sees whom, what is wrong, and what to do. Exit 1 if something is wrong.",
    "keys": "Make certificates for all that take part (init, add, renew, revoke), show when they expire (show), "
    "and print the rules of who may do what (acl).",
    "session": "",
}
"""Commands with their help. One without help is for our own child processes."""


def command(name: str) -> Any:
    """Load a command from its file."""
    return import_module(f"engage_hri.services.commandline.{name.replace('-', '_')}")


def run(words: Sequence[str]) -> int:
    """Run what the words of a command line say. Returns the exit code. Raises InputRefused."""
    match words:
        case []:
            print(commands())
            return REFUSED
        case ["--version", *_]:
            from engage_hri.services.runtime.service import installed_version

            print(f"engage {installed_version()}")
            return DONE
        case [("-h" | "--help"), *_]:
            print(commands())
            return DONE
        case [name, *rest] if name in COMMANDS:
            return _call(name, rest)
        case [str() as option, *_] if option.startswith("-"):
            raise arguments.misused("engage", f"there is no option {option!r}")
        case _:
            raise arguments.misused("engage", f"there is no command {words[0]!r}")


def commands() -> str:
    """Write the list of all commands."""
    indent = 2 + max(map(len, COMMANDS)) + 2
    width = max(40, shutil.get_terminal_size().columns - 2)
    listed = "\n".join(
        textwrap.fill(does, width, initial_indent=f"  {name}".ljust(indent), subsequent_indent=" " * indent)
        for name, does in COMMANDS.items()
        if does
    )
    return f"""\
usage: engage COMMAND ...

The engagement layer for robots that talk with people.

commands:
{listed}

`engage COMMAND --help` lists the options of one, `engage --version` tells which Engage this is."""


def _call(name: str, words: Sequence[str]) -> int:
    module = command(name)
    reader = arguments.reader(module.Options, f"engage {name}", COMMANDS[name])
    if arguments.is_asked_for_help(words):
        print(reader.format_help(), end="")
        return DONE
    options = arguments.read(module.Options, reader, words)
    from engage_hri.services.commandline import logs

    logs.configure(getattr(options, "log", None), getattr(options, "log_level", None) or ())
    return int(module.main(options))


def main(words: Sequence[str] | None = None) -> NoReturn:
    """Run a command. Bad input is one line on standard error, never a traceback; a bug of ours is a traceback."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")  # a terminal that knows no arrows still gets the rest
    sys.exit(exit_code(partial(run, sys.argv[1:] if words is None else words)))
