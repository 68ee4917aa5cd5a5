"""Delays of connection events between machines whose clocks are apart and drift. Real namespaces and processes.

Ground truth is the one clock of the kernel below all machines: what each of them reads differs from it by what the
test has set, and is taken back by the test alone.
"""

import asyncio
import json
import sys
import time
from pathlib import Path
from random import Random
from typing import Any, NamedTuple

import pytest

from engage_hri.schemas import keys
from tests.lab.lab import Lab, Process, laboratory, missing
from tests.lab.test_reach import until

pytestmark = [pytest.mark.real_time, pytest.mark.skipif(bool(missing("time")), reason=missing("time"))]
BODY, RECOGNITION, CAMERA = 1, 2, 3
AHEAD = {BODY: -7, RECOGNITION: 3, CAMERA: 1000}
RATES = {BODY: 50e-6, RECOGNITION: -50e-6, CAMERA: 20e-6}
"""How much too fast each machine's clock goes."""
PATIENCE = 20.0
PAUSE = 0.4
"""Seconds between two meetings of eyes."""
TIMES = 5
MOST = 40
"""Meetings of eyes: at least, and at most until one was measured as well as the paths allow."""
SLACK = 0.006
"""Seconds: by what the clocks drift until they are measured again, and what processes need to answer."""


class Case(NamedTuple):
    """Delays of the paths to recognition and back from it."""

    there: float = 0.0
    back: float = 0.0
    jitter: float = 0.0

    @property
    def trip(self) -> float:
        """Longest round trip."""
        return self.there + self.back + 2 * self.jitter


CASES = {
    "near": Case(),
    "in a house": Case(0.001, 0.001, 0.001),
    "far": Case(0.02, 0.02, 0.02),
    "lopsided": Case(0.04, 0.0),
}


class Clock(NamedTuple):
    """The clock of a machine in a test that began at `since`."""

    machine: int
    since: float

    def true(self, told: float) -> float:
        """The kernel's time when this clock says `told`."""
        began = self.since + AHEAD[self.machine]
        return self.since + (told - began) / (1 + RATES[self.machine])


class Looker:
    """Somebody who looks when told to, on a machine."""

    def __init__(self, process: Process, clock: Clock) -> None:
        self._process = process
        self._clock = clock

    async def look(self, pause: float, *targets: str) -> float:
        """Look there after some seconds; returns the kernel's time at that instant."""
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._process.stdin.write(" ".join((repr(pause), *targets)).encode() + b"\n")
        return self._clock.true(float(await asyncio.wait_for(self._process.stdout.readline(), PATIENCE)))


@pytest.mark.parametrize("name", CASES)
async def test_delays_are_right_and_no_further_off_than_is_told(tmp_path: Path, name: str) -> None:
    case, chance = CASES[name], Random(1)
    async with laboratory(tmp_path, seed=1, ahead=AHEAD) as lab:
        for machine in (BODY, CAMERA):
            for since, to, delay in ((machine, RECOGNITION, case.there), (RECOGNITION, machine, case.back)):
                # Lopsided paths deceive most if the two partners lean to opposite sides.
                since, to = (since, to) if machine == BODY else (to, since)
                await lab.order(order="path", since=since, to=to, delay=delay, jitter=case.jitter)
        watch, body, person = await start(lab)
        wrong, told = [], []
        # A busy machine answers late, and then more is told: the best has to be as good as the paths allow.
        allowed = 0.010 if case.trip < 0.005 else case.trip + SLACK
        while len(told) < TIMES or (min(told) > allowed and len(told) < MOST):
            began = await person.look(PAUSE, "robot")
            answered = await body.look(0.2 + 0.3 * chance.random(), "human")
            event = await decided(watch)
            if event["delay_error"] is not None:
                wrong.append(abs(event["delay"] - (answered - began)))
                told.append(event["delay_error"])
            else:
                assert not told, "a clock that had been measured is forgotten"
            await person.look(0.0)
            await body.look(0.0)
        assert [off for off, error in zip(wrong, told, strict=True) if off > error] == [], (wrong, told)
        assert min(told) <= allowed
        if name == "lopsided":
            assert max(wrong) > 0.03, "the paths do not deceive: this case shows nothing"


async def start(lab: Lab) -> tuple[Process, Looker, Looker]:
    """Start a router and recognition on one machine, the robot's body and a person on two others; and a watcher."""
    since = time.monotonic()
    address = f"tcp/{lab.machines[RECOGNITION].ip}:7447"

    async def run(machine: int, *words: str) -> Process:
        began, rate = repr(since + AHEAD[machine]), repr(RATES[machine])
        return await lab.machines[machine].spawn(
            sys.executable, "-m", "tests.lab.drifting", began, rate, *words,
            stdin=asyncio.subprocess.PIPE, stdout=asyncio.subprocess.PIPE, stderr=asyncio.subprocess.STDOUT,
        )  # fmt: skip

    options = ("--connect", address, "--mode", "client")
    await until(await run(RECOGNITION, "engage_hri", "router", "--listen", address), "router is ready")
    await until(await run(RECOGNITION, "engage_hri", "run", "recognition", *options), "recognition is ready")
    watch = await run(RECOGNITION, "engage_hri", "watch", "--json", "--only", "events", *options)
    body = await run(BODY, "tests.lab.actor", "control", keys.ROBOT_ACTION, "robot", address)
    person = await run(CAMERA, "tests.lab.actor", "perception", keys.PERCEIVED_ACTION, "human", address)
    for process in (body, person):
        await until(process, "ready")
    return watch, Looker(body, Clock(BODY, since)), Looker(person, Clock(CAMERA, since))


async def decided(watch: Process) -> dict[str, Any]:
    """Wait until an event is decided; it has to have succeeded."""
    assert watch.stdout is not None
    while True:
        line = await asyncio.wait_for(watch.stdout.readline(), PATIENCE)
        if line.startswith(b"{"):
            event: dict[str, Any] = json.loads(line)
            if event["kind"] == "mutual_facial_gaze" and event["state"] not in ("started", "completed"):
                assert event["state"] == "succeeded"
                return event
