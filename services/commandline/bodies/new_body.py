"""Command `engage new-body`: write the driver of a robot (`driver.txt`), for its author to go on from.

The file runs and keeps the contract of bodies as it is written, on servos that are simulated. Its author puts an SDK
in their place, and `engage check-body` then tells what that has changed. Its text lies beside this file.
"""

import re
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path
from string import Template
from typing import Annotated

import typer

from engage_hri.schemas.faults import Fault, InputRefused, RunFailed
from engage_hri.services.commandline.shell.outputs import print_format
from engage_hri.services.commandline.shell.process import DONE

NEXT = """\
Wrote {file}: a head on two servos, which are simulated. Next:

  engage check-body {file}
  engage up --body {file} --voice silent

Then put your robot's SDK, joints and lag in it: docs/control.md, "My robot takes set points".
"""


@dataclass(frozen=True, kw_only=True)
class Options:
    name: Annotated[str, typer.Option(metavar="NAME", help="Of the robot: small letters, digits and hyphens.")] = (
        "my-robot"
    )


def main(options: Options) -> int:
    """Write the file. Raises InputRefused if it is there already, RunFailed if it cannot be written."""
    if not re.fullmatch(r"[a-z][a-z0-9]*(-[a-z0-9]+)*", options.name):
        advice = "small letters and digits, with hyphens between words, as in my-robot"
        raise InputRefused(Fault(reason=f"{options.name!r} is no name of a robot", where="--name", advice=advice))
    file = Path(f"{options.name.replace('-', '_')}.py")
    template = Template((files(__package__) / "driver.txt").read_text(encoding="utf-8"))
    text = template.substitute(file=file, name=options.name, class_name=options.name.title().replace("-", ""))
    try:
        with file.open("x", encoding="utf-8") as written:
            written.write(text)
    except FileExistsError:
        advice = "take another --name, or move the file"
        raise InputRefused(Fault(reason="the file is there already", where=str(file), advice=advice)) from None
    except OSError as error:
        raise RunFailed(Fault(reason=f"it cannot be written: {error.strerror}", where=str(file))) from error
    print_format(NEXT.format(file=file).rstrip())
    return DONE
