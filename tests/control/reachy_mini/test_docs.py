"""The page of Reachy Mini: settings and types are those of the driver, commands are understood, numbers hold."""

import re
import shlex
from pathlib import Path

import msgspec

from engage_hri.schemas.references import type_name
from engage_hri.services.control.bases.drivers import check
from engage_hri.services.control.config import ControlConfig
from engage_hri.services.control.reachy_mini import courses, joints
from engage_hri.services.control.reachy_mini.settings import ReachyMiniSettings
from tests.control.reachy_mini import daemon

PAGE = (Path(__file__).parents[3] / "docs" / "reachy-mini.md").read_text(encoding="utf-8")


def test_the_settings_are_those_of_the_driver():
    rows = re.findall(r"^\| `(\w+)` \| `(.+?)` \|", PAGE, re.MULTILINE)
    told = {name: value if name == "url" else msgspec.json.decode(value) for name, value in rows}

    assert told == msgspec.to_builtins(ReachyMiniSettings()) | {"position": [0.0, 0.0, 0.73]}


def test_the_types_of_behaviors_are_those_of_the_driver():
    told = re.findall(r"^\| `(?:head|torso|face)` \| (.+?) \|", PAGE, re.MULTILINE)

    assert sorted([*", ".join(told).split(", "), "wait"]) == sorted(map(type_name, courses.TYPES))


def test_commands_name_what_there_is():
    lines = [line.strip() for block in re.findall(r"```sh\n(.*?)```", PAGE, re.DOTALL) for line in block.splitlines()]
    (up,) = [shlex.split(line) for line in lines if line.startswith("engage up")]
    (started,) = [shlex.split(line) for line in lines if "daemon --mockup-sim" in line]

    check(ControlConfig(body=up[up.index("--body") + 1], voice=up[up.index("--voice") + 1]))
    assert set(started[1:]) <= set(daemon.OPTIONS)
    assert "reachy-mini==1.12.0" in " ".join(lines)
    assert "reachy_mini==1.12.0" in (Path(__file__).parent / "daemon.txt").read_text()


def test_ranges_and_speeds_are_those_of_the_joints():
    limits = {limit.joint: limit for limit in joints.LIMITS}
    yaw, pitch = joints.TRACKS["head"][:2]

    def degrees(angle: float) -> int:
        return round(angle * 57.29578)

    assert (
        f"yaw to {degrees(yaw.high)} degrees either side, from {-degrees(pitch.low)} down to {degrees(pitch.high)} up"
        in PAGE
    )
    head, body = limits["head_yaw"], limits["body_yaw"]
    assert f"at {degrees(head.speed)} degrees/s and {degrees(head.acceleration)} degrees/s² at most" in PAGE
    assert f"the body at {degrees(body.speed)} and {degrees(body.acceleration)}" in PAGE
