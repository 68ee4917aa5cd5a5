"""Command `engage new-body`: write the driver of a robot, for its author to go on from.

The file runs and keeps the contract of bodies as it is written, on servos that are simulated. Its author puts an SDK
in their place, and `engage check-body` then tells what that has changed.
"""

import re
from dataclasses import dataclass
from pathlib import Path
from string import Template
from typing import Annotated

import typer

from engage_hri.schemas.faults import Fault, InputRefused, RunFailed
from engage_hri.services.commandline.shell.failing_output import print_format
from engage_hri.services.commandline.shell.process import DONE

DRIVER = Template('''\
"""A head on two servos that take set points: `engage check-body $file`."""

import math

from engage_hri import Head, JointLimit, Ray, SetPointBody, SimulatedServos


class $class_name(SetPointBody):
    name, part, types = "$name", "head", ("gaze", "gazeShift", "head")
    joints = tuple(
        JointLimit(joint=joint, part="head", low=-1.5, high=1.5, speed=5.0, acceleration=60.0)
        for joint in ("pan", "tilt")
    )
    settling = 0.15  # seconds by which the servos lag

    async def open(self):
        self.servos = SimulatedServos(self.joints)  # your SDK

    def send(self, angles):
        self.servos.send(angles)

    def angles(self):
        return self.servos.angles()

    def aim(self, behavior, world):
        if isinstance(behavior, Head):
            return {"pan": 0.0, "tilt": -0.3}
        x, y, z = (there - here for there, here in zip(self.position(behavior, world), self.eyes, strict=True))
        return {"pan": math.atan2(y, x), "tilt": math.atan2(z, math.hypot(x, y))}

    def gaze(self, angles):
        pan, tilt = angles["pan"], angles["tilt"]
        axis = (math.cos(tilt) * math.cos(pan), math.cos(tilt) * math.sin(pan), math.sin(tilt))
        return Ray(origin=self.eyes, axis=axis)
''')
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
    text = DRIVER.substitute(file=file, name=options.name, class_name=options.name.title().replace("-", ""))
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
