"""The service `control`: puts a body on the bus. It decodes, feeds and publishes; the rest is the body's business."""

import asyncio
from contextlib import aclosing
from math import inf
from typing import Literal

from schemas import keys
from schemas.behaviors import BlockBehavior, Gaze, GazeShift, HeadDirectionShift, Speech
from schemas.body import (
    AbortBehavior,
    BehaviorOutcome,
    BodyPose,
    DescribeBody,
    Estimate,
    EstimateBehaviors,
    Estimates,
    GoHome,
    HomeReached,
    PerformBehavior,
    RobotState,
    SyncPointArrived,
    SyncPointReached,
    WordSpoken,
)
from schemas.faults import Fault, InputRefused
from schemas.messages import Message
from schemas.requests import Cancel, Request
from schemas.units import Seconds
from schemas.world import World
from services.bus import Bus
from services.control import variability
from services.control.actions import ActionMessage, Deeds
from services.control.body import Arrived, Authority, BehaviorRefused, Body, BodyFailed, Progress, Reached, Spoke
from services.control.config import ControlConfig
from services.control.simulated import SimulatedBody
from services.covered import CoveredObjects
from services.requests import RequestDesk
from services.runtime import Ready

IDLE: Seconds = 1.0
"""Between two `RobotState` while nothing moves."""


async def embody(bus: Bus, ready: Ready, config: ControlConfig, body: Body | None = None) -> None:
    """Serve until cancelled. body: the simulated one unless given."""
    async with asyncio.TaskGroup() as tasks:
        control = _Control(bus, config, body or SimulatedBody(config.no_point_zones, config.variability), tasks)
        with bus.subscribe(*RequestDesk.patterns("control"), keys.WORLD) as inbox:
            bus.answer(keys.ESTIMATE, control.estimate)
            bus.answer(keys.DESCRIBE, control.describe)
            ready()
            try:
                control.publish_state()
                async for received in inbox:
                    if isinstance(received.message, World):
                        control.see(received.message)
                        continue
                    if (request := control.desk.take(received)) is not None:
                        control.serve(request)
                    if isinstance(received.message, Request):
                        control.heard_from(received.message.requester)
            finally:
                control.close()


class _Performance:
    """A `PerformBehavior` that is under way."""

    def __init__(self, request: PerformBehavior, authority: Authority) -> None:
        self.request = request
        self.authority = authority
        self.position = 0
        self.status: Literal["done", "aborted", "failed"] = "aborted"

    @property
    def label(self) -> str:
        return f"{self.request.block}:{self.request.behavior.id}"

    @property
    def spoken(self) -> str:
        """What the voice has said of it."""
        behavior = self.request.behavior
        return behavior.text[: self.position] if isinstance(behavior, Speech) else ""


class _Control:
    """What the loop of `embody` feeds."""

    def __init__(self, bus: Bus, config: ControlConfig, body: Body, tasks: asyncio.TaskGroup) -> None:
        self.desk = RequestDesk(bus, "control", self._requester_lost)
        self._bus = bus
        self._config = config
        self._body = body
        self._tasks = tasks
        self._deeds = Deeds(bus.robot, bus.clock)
        self._world = World(entities=())
        self._objects = CoveredObjects(config.covered_for)
        self._live: dict[str, _Performance] = {}
        self._sent = 0
        self._loop = asyncio.get_running_loop()
        self._silence: dict[str, asyncio.TimerHandle] = {}
        self._next_state: asyncio.TimerHandle | None = None
        self._next_state_at = inf
        self._published: Seconds = -inf

    # -- reads --------------------------------------------------------------------------------------------------

    def estimate(self, question: Message) -> Message:
        if not isinstance(question, EstimateBehaviors):
            raise InputRefused(Fault(reason="expected EstimateBehaviors", where=keys.ESTIMATE, service="control"))
        return Estimates(items=tuple(self._estimated(item.behavior, item.pose) for item in question.items))

    def _estimated(self, behavior: BlockBehavior, pose: BodyPose | None) -> Estimate:
        return self._body.estimate(behavior, pose, self._world)

    def describe(self, question: Message) -> Message:
        if not isinstance(question, DescribeBody):
            raise InputRefused(Fault(reason="expected DescribeBody", where=keys.DESCRIBE, service="control"))
        return self._body.capabilities

    # -- requests -----------------------------------------------------------------------------------------------

    def see(self, world: World) -> None:
        self._world = self._objects.see(world, self._bus.now())
        self._body.see(self._world)
        self.note_look()
        if self._body.state().moving:
            self._keep_publishing()

    def serve(self, request: Request) -> None:
        """A request that is new, or that says something new about a live one."""
        live = self._live.get(request.id)
        match request:
            case PerformBehavior() if live is not None:
                self._extend(live, request)
            case PerformBehavior():
                self._begin(request)
            case AbortBehavior(how=how) if live is not None:
                live.authority.revoke(how)
            case Cancel() if live is not None:
                live.authority.revoke()
            case GoHome():
                self.desk.accept(request.id)
                self._tasks.create_task(self._go_home(request), name=f"home {request.id}")
            case AbortBehavior():
                self.desk.refuse(request.id, Fault(reason="no such behavior", where=request.id, service="control"))

    def _begin(self, request: PerformBehavior) -> None:
        try:
            authority = Authority(request.behavior, request.through, self._pace(request))
        except ValueError as error:
            self.desk.refuse(request.id, Fault(reason=str(error), where=request.behavior.id, service="control"))
            return
        live = self._live[request.id] = _Performance(request, authority)
        self._tasks.create_task(self._perform(live), name=f"behavior {request.id}")

    def _pace(self, request: PerformBehavior) -> dict[str, Seconds]:
        return {planned.sync: self._bus.local(planned.at) for planned in request.pace}

    def _extend(self, live: _Performance, request: PerformBehavior) -> None:
        live.authority.set_pace(self._pace(request))
        try:
            live.authority.extend(request.through)
        except ValueError as error:
            where = live.request.behavior.id
            self._bus.publish(keys.fault("control"), Fault(reason=str(error), where=where, service="control"))

    async def _perform(self, live: _Performance) -> None:
        """From the request to its one terminal state."""
        request, fault = live.request, None
        accepted = False
        try:
            async with aclosing(self._body.perform(request.behavior, live.authority)) as stream:
                async for progress in stream:
                    if not accepted:
                        self.desk.accept(request.id)
                        accepted = True
                    self._report(live, progress)
        except BehaviorRefused as error:
            del self._live[request.id]
            self.desk.refuse(request.id, error.fault)
            return
        except BodyFailed as error:
            live.status, fault = "failed", error.fault
        del self._live[request.id]
        at = self._bus.now()
        self._publish(self._deeds.ended(request.id, at))
        self.note_look()
        self._keep_publishing()
        self.desk.end(
            BehaviorOutcome(
                id=request.id,
                block=request.block,
                behavior=request.behavior.id,
                status=live.status,
                at=self._bus.stamp(at),
                spoken=live.spoken,
                fault=fault,
            )
        )

    async def _go_home(self, request: GoHome) -> None:
        await self._body.home(request.parts)
        self.note_look()
        self.desk.end(HomeReached(id=request.id, at=self._bus.stamp()))

    # -- reports ------------------------------------------------------------------------------------------------

    def _report(self, live: _Performance, progress: Progress) -> None:
        request = live.request
        id, block, behavior = request.id, request.block, request.behavior.id
        match progress:
            case Arrived(sync=sync, at=at):
                self._tell(SyncPointArrived(id=id, block=block, behavior=behavior, sync=sync, at=self._bus.stamp(at)))
                self.note_look(live, at)
            case Reached(sync=sync, at=at, arrived=arrived):
                self._tell(
                    SyncPointReached(
                        id=id,
                        block=block,
                        behavior=behavior,
                        sync=sync,
                        at=self._bus.stamp(at),
                        arrived=self._bus.stamp(arrived),
                    )
                )
                live.status = "done" if sync == "end" else live.status
                self._publish(self._deeds.reached(request.id, live.label, request.behavior, progress))
                self.note_look(live, at)
            case Spoke(word=word, position=position, at=at):
                live.position = position
                stamp = self._bus.stamp(at)
                self._tell(WordSpoken(block=block, behavior=behavior, word=word, position=position, at=stamp))
        self._keep_publishing()

    def _tell(self, message: SyncPointArrived | SyncPointReached | WordSpoken) -> None:
        self._sent += 1
        if not variability.is_lost(self._config.variability, self._sent, message.at.seconds):
            self._bus.publish(keys.SYNC_POINT, message)

    def _publish(self, actions: list[ActionMessage]) -> None:
        for action in actions:
            self._bus.publish(keys.ROBOT_ACTION, action)

    def note_look(self, live: _Performance | None = None, at: Seconds | None = None) -> None:
        """Publish what the eyes rest on, if that has changed."""
        of_head = live is not None and isinstance(live.request.behavior, Gaze | GazeShift | HeadDirectionShift)
        label = live.label if live is not None and of_head else ""
        entity = self._body.state().looking_at
        self._publish(self._deeds.looks_at(entity, label, self._bus.now() if at is None else at))

    def publish_state(self) -> None:
        """Tell how the body stands, and once more after a while: soon if it moves."""
        now, state = self._bus.now(), self._body.state()
        self._publish(self._deeds.looks_at(state.looking_at, "", now))
        self._published = now
        self._bus.publish(
            keys.ROBOT_STATE,
            RobotState(
                at=self._bus.stamp(now), pose=state.pose, gaze=state.gaze, left_arm=state.left_arm,
                right_arm=state.right_arm, looking_at=state.looking_at, speaking=state.speaking,
            ),
        )  # fmt: skip
        self._schedule_state(now + (1.0 / self._config.state_rate if state.moving else IDLE))

    def _keep_publishing(self) -> None:
        """Something has begun to move."""
        due = self._published + 1.0 / self._config.state_rate
        if self._next_state_at > due:
            self._schedule_state(due)

    def _schedule_state(self, at: Seconds) -> None:
        if self._next_state is not None:
            self._next_state.cancel()
        self._next_state_at = at  # uvloop's handles do not tell their time when it has passed
        self._next_state = self._loop.call_at(at, self.publish_state)

    # -- dead man -----------------------------------------------------------------------------------------------

    def heard_from(self, requester: str) -> None:
        """Requests are repeated while they live: a requester that falls silent in mid-behavior is gone."""
        if timer := self._silence.pop(requester, None):
            timer.cancel()
        if any(live.request.requester == requester for live in self._live.values()):
            self._silence[requester] = self._loop.call_later(self._config.dead_man, self._let_go, requester)

    def _requester_lost(self, cancel: Cancel) -> None:
        self._let_go(cancel.requester)

    def _let_go(self, requester: str) -> None:
        """Nobody directs these behaviors any more: end them, and take everything to the safe pose."""
        abandoned = [live for live in self._live.values() if live.request.requester == requester]
        for live in abandoned:
            live.authority.revoke()
        if abandoned:
            self._tasks.create_task(self._body.home(), name=f"home after {requester}")
            self._keep_publishing()

    def close(self) -> None:
        self.desk.close()
        for timer in (self._next_state, *self._silence.values()):
            if timer is not None:
                timer.cancel()
