"""A daemon of a Reachy Mini on loop time, no better than the real one: `test_mockup.py` compares them.

The real mock-up takes a target at the end of a tick of 20 ms, and is there at the end of the next one. It goes where
it is told at once, however far; it tells its joints 43 times a second when 50 are asked for; it begins folded down.
"""

import asyncio
import math
from collections.abc import AsyncIterator, Iterator
from contextlib import asynccontextmanager
from itertools import repeat
from random import Random

import msgspec

from engage_hri.schemas.faults import Fault
from engage_hri.services.control.bases.linked import Link, Lost
from engage_hri.services.control.reachy_mini import joints
from engage_hri.services.control.reachy_mini.settings import ReachyMiniSettings

TICK = 0.02
PERIOD = 0.0232
ASLEEP = {"yaw": 0.0, "pitch": 0.43, "roll": 0.0, "x": -0.021, "y": 0.0, "z": -0.044}
FOLDED = (-3.05, 3.05)


class FakeDaemon:
    """Its faults can be set at any time.

    noise: of each angle, radians. sag: by how much the head hangs lower than it was told. stuck: angles that do not
    move. slow: the greatest speed of head and antennas, rad/s. bent: by how much the antennas stand off, radians.
    mode: of the motors; unless they are enabled nothing moves.
    """

    def __init__(self) -> None:
        self.noise = 0.0
        self.sag = 0.0
        self.stuck: set[str] = set()
        self.slow = math.inf
        self.bent = 0.0
        self.mode = "enabled"
        self.is_running = True
        self.garbage = ""
        self.is_upside_down = False
        """What it computes of the head from its motors, as the real one may after a jump."""
        self.commands: list[tuple[float, dict[str, float]]] = []
        """Everything that has been carried out, with its time."""
        self.periods: Iterator[float] = repeat(PERIOD)
        """Seconds to each next measurement."""
        self._queue: list[str] = []
        self._chance = Random(1)
        self._thawed = asyncio.Event()
        self._thawed.set()
        self._life = 0
        self._begin()

    def _begin(self) -> None:
        self._pose = {**ASLEEP, "body_yaw": 0.0, "right": FOLDED[0], "left": FOLDED[1]}
        self._target: dict[str, float] | None = None
        self._coming: list[tuple[float, dict[str, float]]] = []
        self._moved_at = asyncio.get_running_loop().time()

    # -- what may happen ----------------------------------------------------------------------------------------

    def freeze(self) -> None:
        self._thawed.clear()

    def thaw(self) -> None:
        self._thawed.set()

    def kill(self) -> None:
        self.is_running = False
        self._life += 1

    def start(self) -> None:
        """Start again, folded down."""
        self.is_running = True
        self.is_upside_down = False
        self._begin()

    def move_by_hand(self, **angles: float) -> None:
        """Have another app put the joints elsewhere."""
        self._advance(asyncio.get_running_loop().time())
        self._coming = []
        self._pose |= angles
        self._target = dict(self._pose)

    # -- as a connection ----------------------------------------------------------------------------------------

    @asynccontextmanager
    async def __call__(self, settings: ReachyMiniSettings) -> AsyncIterator[Link]:
        if not self.is_running:
            raise Lost(Fault(reason=f"the daemon at {settings.url} cannot be reached: refused", advice="start it"))
        await self._answer()
        if settings.enable_motors:
            self.mode = "enabled"
        yield _Connection(self, self._life)

    async def _answer(self) -> None:
        """A frozen daemon does not answer: whoever asks gives up after a while."""
        if not self._thawed.is_set():
            try:
                async with asyncio.timeout(2.0):
                    await self._thawed.wait()
            except TimeoutError:
                raise Lost(Fault(reason="the daemon cannot be reached: no answer", advice="start it")) from None

    async def measurement(self, life: int) -> str | bytes:
        await asyncio.sleep(next(self.periods))
        await self._thawed.wait()
        if life != self._life:
            raise Lost(Fault(reason="the daemon has closed the connection", advice="start it"))
        for text in self._queue:
            self._take(text)
        self._queue = []
        return self.garbage or self._state()

    def command(self, text: str, life: int) -> None:
        if life != self._life:
            raise Lost(Fault(reason="the daemon has closed the connection", advice="start it"))
        if self._thawed.is_set():
            self._take(text)
        else:
            self._queue.append(text)

    # -- joints -------------------------------------------------------------------------------------------------

    def _take(self, text: str) -> None:
        told = msgspec.json.decode(text)
        right, left = told["target_antennas"]
        pose = {**told["target_head_pose"], "body_yaw": told["target_body_yaw"], "right": right, "left": left}
        now = asyncio.get_running_loop().time()
        self.commands.append((now, pose))
        self._coming.append(((math.floor(now / TICK) + 2) * TICK, pose))

    def _state(self) -> bytes:
        self._advance(asyncio.get_running_loop().time())
        pose = {
            name: angle + self._chance.gauss(0.0, self.noise) if self.noise else angle
            for name, angle in self._pose.items()
        }
        head = {name: pose[name] for name in ("yaw", "pitch", "roll")} | {
            name: self._pose[name] for name in ("x", "y", "z")
        }
        if self.is_upside_down:
            head |= {"yaw": math.pi - 0.1, "z": -0.056}
        return msgspec.json.encode(
            {"control_mode": self.mode, "head_pose": head, "body_yaw": pose["body_yaw"],
             "antennas_position": [pose["right"], pose["left"]], "timestamp": "2026-11-24T09:35:20.051659Z"}
        )  # fmt: skip

    def _advance(self, now: float) -> None:
        """Let the joints go after their targets, tick by tick."""
        while self._coming and self._coming[0][0] <= now:
            at, target = self._coming.pop(0)
            self._go(at)
            self._target = target
            self._go(at + 1e-6)
        self._go(now)

    def _go(self, now: float) -> None:
        since, self._moved_at = max(0.0, now - self._moved_at), now
        if self.mode != "enabled" or self._target is None:
            return
        target = {**self._target, "pitch": self._target["pitch"] + self.sag}
        target |= {"right": target["right"] + self.bent, "left": target["left"] + self.bent}
        aside = math.remainder(target["yaw"] - target["body_yaw"], math.tau)
        if abs(aside) > math.radians(65.0):  # it takes the body along
            target["body_yaw"] = target["yaw"] - math.copysign(math.radians(65.0), aside)
        for name, angle in target.items():
            if name not in self.stuck:
                way = angle - self._pose[name]
                is_slow = self.slow < math.inf and name not in ("body_yaw", "x", "y", "z")
                limit = self.slow * since if is_slow else math.inf
                self._pose[name] += max(-limit, min(limit, way))


class _Connection:
    def __init__(self, daemon: FakeDaemon, life: int) -> None:
        self._daemon, self._life = daemon, life

    async def measurement(self) -> str | bytes:
        return await self._daemon.measurement(self._life)

    async def command(self, text: str) -> None:
        self._daemon.command(text, self._life)


HOME = {
    "yaw": 0.0, "pitch": 0.0, "roll": 0.0, "body_yaw": 0.0, "right": joints.HOME["face"][0],
    "left": joints.HOME["face"][1],
}  # fmt: skip
