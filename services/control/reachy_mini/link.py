"""The link to the daemon of a Reachy Mini: its messages, version 1.12, and a connection that is found again.

`/api/state/ws/full` sends the head's pose, which the daemon computes from the measured motors, the turn of the body,
both antennas, and whether the motors are on. `/api/move/ws/set_target` takes a target, and answers nothing.

A connection is lost once, says why, and is found again. A command goes out only as an answer to a measurement. So
nothing piles up in front of a daemon that has stopped, and what it had not read is not carried out when it goes on.
"""

import asyncio
import math
from abc import abstractmethod
from collections.abc import AsyncIterator, Callable
from contextlib import AbstractAsyncContextManager, asynccontextmanager
from math import inf
from typing import Protocol

import msgspec
from msgspec import Struct
from msgspec.structs import replace

from engage_hri.schemas.faults import EngageError, Fault, RunFailed
from engage_hri.schemas.units import Seconds
from engage_hri.services.control.contract.body import Body, BodyFailed
from engage_hri.services.control.reachy_mini.joints import Angles, head_place, lean
from engage_hri.services.control.reachy_mini.settings import ReachyMiniSettings

ENABLED = "enabled"
FARTHEST_ASIDE = math.radians(100.0)
FARTHEST_OVER = math.radians(70.0)


class _Pose(Struct):
    x: float = 0.0
    y: float = 0.0
    z: float = 0.0
    roll: float = 0.0
    pitch: float = 0.0
    yaw: float = 0.0


class _State(Struct):
    head_pose: _Pose
    body_yaw: float
    antennas_position: tuple[float, float]
    control_mode: str


class _Target(Struct):
    target_head_pose: _Pose
    target_antennas: tuple[float, float]
    target_body_yaw: float


class Measured(Struct, frozen=True):
    """The joints at one instant, radians. mode: of the motors, `enabled` if they hold and move the joints."""

    pose: dict[str, float]
    mode: str

    @property
    def is_possible(self) -> bool:
        """False if no neck can be so: the daemon's forward kinematics has come to a solution upside down."""
        aside = self.pose["head_yaw"] - self.pose["body_yaw"]
        aside = abs(math.remainder(aside, math.tau))
        return (
            aside < FARTHEST_ASIDE
            and max(map(abs, (self.pose["head_pitch"], self.pose["head_roll"]))) < FARTHEST_OVER
        )


_decoder = msgspec.json.Decoder(_State)


def read(text: str | bytes) -> Measured:
    """Read a measurement. Raises ValueError: it is none."""
    try:
        state = _decoder.decode(text)
    except msgspec.MsgspecError as error:
        raise ValueError(f"{error}: {text[:80]!r}") from error
    head = state.head_pose
    right, left = state.antennas_position
    pose = {
        "head_yaw": head.yaw, "head_pitch": -head.pitch, "head_roll": -head.roll, "body_yaw": state.body_yaw,
        "body_lean": lean(head.x, head.y, state.body_yaw), "right_antenna": right, "left_antenna": left,
    }  # fmt: skip
    return Measured(pose, state.control_mode)


def target(pose: Angles) -> str:
    """Write a target for all joints, radians."""
    x, y, z = head_place(pose)
    head = _Pose(x=x, y=y, z=z, roll=-pose["head_roll"], pitch=-pose["head_pitch"], yaw=pose["head_yaw"])
    antennas = (pose["right_antenna"], pose["left_antenna"])
    return msgspec.json.encode(
        _Target(target_head_pose=head, target_antennas=antennas, target_body_yaw=pose["body_yaw"])
    ).decode()


AGAIN: Seconds = 0.5
"""Seconds between two attempts to find the daemon."""
STARVED: Seconds = 0.1
"""A timer that comes so late tells of a process that had no time."""
COUNTED = 16
"""Measurements whose mean tells how often they come."""
GAP_THAT_COUNTS: Seconds = 0.5
"""A longer one counts as this: it may be the only one."""
GAP: Seconds = 0.15
"""Mean seconds from one measurement to the next with which one can move."""
VERSION = "this driver knows the daemon's versions 1.12; see docs/reachy-mini.md"


class Lost(EngageError):
    """The daemon cannot be had, or does not answer any more."""


class Daemon(Protocol):
    """An open connection."""

    async def measurement(self) -> str | bytes:
        """Wait for the next measurement. Raises Lost."""

    async def command(self, text: str) -> None:
        """Send a target. Raises Lost."""


Connect = Callable[[ReachyMiniSettings], AbstractAsyncContextManager[Daemon]]


class LinkedBody(Body):
    """A body on a link to the daemon. trouble: why the robot cannot be moved now; None: it can.

    is_linked: somebody uses it; before that, and after it, nothing is told. last_frame: time of the last measurement.
    """

    def __init__(self, settings: ReachyMiniSettings, connect: Connect) -> None:
        self.settings, self._connect = settings, connect
        self.trouble: Fault | None = None
        self.is_linked = False
        self.last_frame: Seconds = -inf
        self._mean: Seconds = 0.0
        self._is_slow = False
        self._has_news = asyncio.Event()
        """Set by the first measurement, and by the first trouble."""

    @asynccontextmanager
    async def connected(self) -> AsyncIterator[None]:
        self._has_news.clear()
        keeping = asyncio.create_task(self._keep(), name="link to reachy mini")
        keeping.add_done_callback(lambda task: self._has_news.set())
        try:
            await self._has_news.wait()
            if keeping.done():
                keeping.result()
            if self.trouble is not None:
                raise RunFailed(self.trouble)
            self.is_linked = True
            try:
                await self.home()
            except BodyFailed as failed:
                raise RunFailed(failed.fault) from failed
            yield
        finally:
            self.is_linked, self.trouble = False, None
            keeping.cancel()
            await asyncio.gather(keeping, return_exceptions=True)

    @abstractmethod
    def answer(self, measured: Measured) -> str | None:
        """Take a measurement, and answer it with where the joints are to be now; None: where they were sent."""

    @abstractmethod
    def be_back(self, measured: Measured) -> None:
        """Begin anew from where the joints are, and go home from there."""

    @abstractmethod
    def ring(self) -> None:
        """Wake all that wait for measurements."""

    async def _keep(self) -> None:
        """Keep the connection until cancelled."""
        while True:
            try:
                async with self._connect(self.settings) as daemon:
                    while True:
                        await self._converse(daemon)
            except Lost as lost:
                self._lose(lost.fault)
            await asyncio.sleep(AGAIN)

    async def _converse(self, daemon: Daemon) -> None:
        """Take a measurement, and answer it. Raises Lost."""
        text = await _heard(daemon, self.settings.silence)
        try:
            measured = read(text)
        except ValueError as error:
            raise Lost(Fault(reason=f"the daemon sends what is no measurement: {error}", advice=VERSION)) from error
        if (trouble := _trouble_of(measured)) is not None:
            self._lose(trouble)
            return
        now = asyncio.get_running_loop().time()
        if self.trouble is not None or not self._has_news.is_set():
            self.trouble, self.last_frame, self._mean, self._is_slow = None, now, 0.0, False
            if self.is_linked:
                self.on_recovery("reachy_mini: it can be moved again, and goes home")
            self.be_back(measured)
            self._has_news.set()
        self._count(now - self.last_frame)
        command, self.last_frame = self.answer(measured), now
        self.ring()
        if command is not None:
            try:
                async with asyncio.timeout(self.settings.silence):
                    await daemon.command(command)
            except TimeoutError:
                raise Lost(_silent(self.settings.silence)) from None

    def _count(self, gap: Seconds) -> None:
        """Tell of measurements that have become too few, or enough. One long gap alone is no slow stream."""
        self._mean += (min(gap, GAP_THAT_COUNTS) - self._mean) / COUNTED
        was_slow, self._is_slow = self._is_slow, self._mean > GAP / (1.5 if self._is_slow else 1.0)
        if self._is_slow and not was_slow:
            often = f"the daemon sends {1.0 / self._mean:.1f} measurements a second"
            reason = f"{often}: the robot moves by fits and starts, and late"
            advice = f"it takes {1.0 / GAP:.0f}; is the network slow, or the daemon's machine busy?"
            self.on_fault(Fault(reason=reason, where="reachy_mini", advice=advice, service="control"))
        elif was_slow and not self._is_slow:
            self.on_recovery("reachy_mini: the daemon sends enough measurements again")

    def _lose(self, fault: Fault) -> None:
        """Tell of trouble, once until it is over."""
        if self.trouble is None:
            self.trouble = replace(fault, where=fault.where or "reachy_mini", service="control")
            if self.is_linked:
                self.on_fault(self.trouble)
            self.ring()
            self._has_news.set()


async def _heard(daemon: Daemon, silence: Seconds) -> str | bytes:
    """Wait for the next measurement. Raises Lost after the silence.

    A process that had no time itself knows nothing of a silence: what was sent meanwhile has not been read yet.
    """
    loop = asyncio.get_running_loop()
    for is_last in (False, True):
        until = loop.time() + silence
        try:
            async with asyncio.timeout_at(until):
                return await daemon.measurement()
        except TimeoutError:
            if is_last or loop.time() - until < STARVED:
                break
    raise Lost(_silent(silence))


def _silent(seconds: Seconds) -> Fault:
    reason = f"the daemon has sent no measurement for {seconds:g} s"
    return Fault(reason=reason, advice="it is frozen, or the network is cut; the driver tries again")


def _trouble_of(measured: Measured) -> Fault | None:
    """Trouble that a measurement tells of; None: the robot can be moved."""
    if measured.mode != ENABLED:
        advice = (
            "switch them on, in the vendor's app or by POST /api/motors/set_mode/enabled; the robot then goes home"
        )
        return Fault(reason=f"the motors are {measured.mode.replace('_', ' ')}", advice=advice)
    if not measured.is_possible:
        advice = "its forward kinematics has lost itself, as after a jump of the head: restart it"
        return Fault(reason="the daemon measures a pose that no head can have", advice=advice)
    return None
