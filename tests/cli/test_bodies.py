"""A body of one's own in the commands that have one: the driver of docs/control.md on a simulated SDK."""

import asyncio
import signal
from pathlib import Path

import pytest

from engage_hri.schemas.behaviors import Gaze, Speech
from engage_hri.schemas.fragments import TurnFragment
from engage_hri.services.client.robot import connect
from tests.bus.places import free_endpoint
from tests.cli.command import Engage, start
from tests.control.test_docs import CODE

SDK = '''
"""Two motors on a table: they go where they are told in the time they are told, and lag a little."""
import asyncio

class Motors:
    def __init__(self):
        self.start = self.goal = {"pan": 0.0, "tilt": 0.0}
        self.since, self.seconds, self.connected = 0.0, 0.0, False

    def connect(self):
        self.connected = True

    def move(self, goal, seconds):
        assert self.connected
        self.start, self.goal = self.measured(), goal
        self.since, self.seconds = asyncio.get_running_loop().time(), seconds

    def measured(self):
        assert self.connected
        gone = asyncio.get_running_loop().time() - 0.02 - self.since
        share = min(1.0, max(0.0, gone / self.seconds)) if self.seconds else 1.0
        share = share * share * (3 - 2 * share)
        return {joint: angle + share * (self.goal[joint] - angle) for joint, angle in self.start.items()}
'''
BREAKING = """
from pan_tilt import PanTilt

class Open(PanTilt):
    async def open(self):
        raise OSError("open broke")

class Go(PanTilt):
    def go(self, goal, seconds):
        raise OSError("go broke")

class Aim(PanTilt):
    def aim(self, behavior, world):
        raise ValueError("aim broke")

class Angles(PanTilt):
    count = 0

    def angles(self):
        self.count += 1
        if self.count > 40:
            raise OSError("angles broke")
        return super().angles()
"""
ASK = """<ebml:ebml xmlns:ebml="edu.wpi.ebml" xmlns="org.mindmakers.bml" id="ask" turnIndex="1" turnStatus="full">
  <speech id="please"><text>Please move</text></speech>
  <ebml:reference id="piece" target="blue-square" minReliability="0.95">
    <ebml:speechOption text="the blue piece" cost="3"/>
  </ebml:reference>
</ebml:ebml>
"""


@pytest.fixture
def robot(tmp_path: Path) -> str:
    (tmp_path / "pan_tilt.py").write_text(CODE)
    (tmp_path / "pan_tilt_sdk.py").write_text(SDK)
    (tmp_path / "ask.xml").write_text(ASK)
    return f"{tmp_path / 'pan_tilt.py'}:PanTilt"


def test_it_looks_while_another_driver_speaks(engage: Engage, tmp_path: Path, robot: str) -> None:
    ask = tmp_path / "ask.xml"
    result = engage("play", ask, "--embedded", "--virtual-time", "--body", robot, "--voice", "silent")

    assert result.code == 0, result.err
    assert "robot looks at blue-square" in result.out
    assert 'Said: "Please move the blue piece". blue-square: the blue piece, by a look' in result.out
    assert "points" not in result.out


def test_without_a_voice_the_turn_has_failed_and_is_told_what_to_do(
    engage: Engage, tmp_path: Path, robot: str
) -> None:
    result = engage("play", tmp_path / "ask.xml", "--embedded", "--virtual-time", "--body", robot)

    assert result.code == 3
    assert "none of its words was spoken" in result.err
    assert "--voice silent" in result.err


@pytest.mark.parametrize("command", [("plan",), ("plan", "--why")])
def test_it_is_asked_for_estimates_without_a_connection(
    engage: Engage, tmp_path: Path, robot: str, command: tuple[str, ...]
) -> None:
    result = engage(*command, tmp_path / "ask.xml", "--body", robot, "--voice", "silent")

    assert result.code == 0, result.err
    assert "AssertionError" not in result.err


@pytest.mark.parametrize("command", [("plan",), ("plan", "--why")])
def test_a_wrong_body_is_not_the_fault_of_the_file(
    engage: Engage, tmp_path: Path, robot: str, command: tuple[str, ...]
) -> None:
    body = engage(*command, tmp_path / "ask.xml", "--body", "nosuch")
    voice = engage(*command, tmp_path / "ask.xml", "--voice", "nosuch")

    assert (body.code, voice.code) == (2, 2)
    assert body.err.startswith("body nosuch: no body 'nosuch' (known are ")
    assert voice.err.startswith("voice nosuch: no voice 'nosuch' (known are espeak, silent; or ")


@pytest.mark.parametrize(
    ("arguments", "reason"),
    [
        (("plan", "ask.xml", "--body", "nowhere.py:Body"), "no file nowhere.py"),
        (
            ("play", "ask.xml", "--embedded", "--body", "simulated", "--body", "simulated"),
            "both have the part 'head'",
        ),
        (("play", "ask.xml", "--body", "simulated"), "--body is for a private system (add --embedded)"),
        (("run", "generation", "--body", "simulated"), "--body and --voice are for control"),
        (("up", "--body", "nowhere:Body"), "No module named 'nowhere'"),
    ],
)
def test_what_is_no_body_is_refused(
    engage: Engage, tmp_path: Path, robot: str, arguments: tuple[str, ...], reason: str
) -> None:
    result = engage(*(str(tmp_path / each) if each == "ask.xml" else each for each in arguments))

    assert result.code == 2
    assert reason in result.err
    assert "Traceback" not in result.err


@pytest.mark.real_time
@pytest.mark.parametrize("in_one", [True, False])
async def test_it_is_put_on_by_up(tmp_path: Path, robot: str, in_one: bool) -> None:
    endpoint = free_endpoint()
    options = ("--body", robot, "--voice", "silent", "--robot", "pan", *(("--in-one",) if in_one else ()))
    up = await start("up", "--listen", endpoint, *options)
    try:
        async with asyncio.timeout(40.0), connect("pan", connect=[endpoint]) as client:
            await client.person()
            fragment = TurnFragment(
                id="a", behaviors=(Speech(id="s", text="Hello"), Gaze(id="g", target="blue-square"))
            )
            outcome = await client.perform(fragment)
    finally:
        up.send_signal(signal.SIGINT)
        out, err = await up.communicate()

    assert outcome.status == "done", err.decode()
    assert "Traceback" not in (out + err).decode()


def test_a_driver_that_breaks_costs_what_it_did_and_is_named(engage: Engage, tmp_path: Path, robot: str) -> None:
    """In each call of the base class. A traceback would be a bug of ours."""
    (tmp_path / "breaking.py").write_text(BREAKING)
    found = {}
    for name in ("Open", "Go", "Aim", "Angles"):
        body = f"{tmp_path / 'breaking.py'}:{name}"
        result = engage(
            "play", tmp_path / "ask.xml", "--embedded", "--virtual-time", "--body", body, "--voice", "silent"
        )
        text = result.out + result.err
        assert "Traceback" not in text
        assert f"{name.lower()} broke (see {tmp_path / 'breaking.py'}, line " in text
        found[name] = result.code, "the blue piece" in text

    assert found == {"Open": (3, False), "Go": (0, True), "Aim": (0, True), "Angles": (0, True)}
