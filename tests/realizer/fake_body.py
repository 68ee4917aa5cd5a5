"""A body at message level: the durations it is told, the authority it is given, and the faults it is told to have.

It behaves on the bus as control does: it waits at hold points until its authority covers them, says so, takes a part
from whatever has it when another behavior comes, and ends every request exactly once.
"""

import asyncio
from collections.abc import Mapping
from contextlib import suppress
from itertools import pairwise
from math import inf

from msgspec import Struct, field

from engage_hri.schemas import keys
from engage_hri.schemas.behaviors import BlockBehavior, Gesture, Pointing, Speech
from engage_hri.schemas.body import (
    AbortBehavior,
    BehaviorAborted,
    BehaviorOutcome,
    Estimate,
    EstimateBehaviors,
    Estimates,
    GoHome,
    HomeReached,
    PerformBehavior,
    Phase,
    SyncPointArrived,
    SyncPointReached,
)
from engage_hri.schemas.faults import Fault
from engage_hri.schemas.messages import Message
from engage_hri.schemas.requests import Cancel
from engage_hri.schemas.units import Seconds
from engage_hri.services.bus.interface import Bus
from engage_hri.services.requests.ends import RequestDesk
from engage_hri.services.runtime.service import Ready

SEVEN = ("start", "ready", "stroke_start", "stroke", "stroke_end", "relax", "end")
HOLDS = {
    "gesture": ("stroke_start", "stroke_end"),
    "pointing": ("stroke_start", "stroke_end"),
    "head": ("stroke_start", "stroke_end"),
    "gaze": ("stroke", "relax"),
    "face": ("stroke", "relax"),
    "faceLexeme": ("stroke", "relax"),
    "faceFacs": ("stroke", "relax"),
    "posture": ("stroke", "relax"),
}
SHIFTS = ("gazeShift", "headDirectionShift")
PART = {
    "head": "nod", "gaze": "head", "gazeShift": "head", "headDirectionShift": "head", "speech": "voice",
    "posture": "torso", "postureShift": "torso", "pose": "torso",
}  # fmt: skip
ARMS = {None: ("right_arm",), "RIGHT_HAND": ("right_arm",), "LEFT_HAND": ("left_arm",)}
DURATIONS: dict[str, tuple[Seconds, ...]] = {
    "pointing": (0.5, 0.25, 0.5, 0.25, 0.25, 0.5),
    "gesture": (0.5, 0.25, 0.5, 0.25, 0.25, 0.5),
    "head": (0.25, 0.0, 0.25, 0.25, 0.0, 0.25),
    "gaze": (0.0, 0.0, 0.5, 0.0, 0.0, 0.5),
    "face": (0.25, 0.0, 0.0, 0.0, 0.0, 0.25),
    "faceLexeme": (0.25, 0.0, 0.0, 0.0, 0.0, 0.25),
    "faceFacs": (0.25, 0.0, 0.0, 0.0, 0.0, 0.25),
    "posture": (0.5, 0.0, 0.0, 0.0, 0.0, 0.5),
}
"""Seconds per phase: binary fractions, so that times come out exact."""


def type_of(behavior: BlockBehavior) -> str:
    return str(behavior.__struct_config__.tag)


def points_of(behavior: BlockBehavior) -> tuple[str, ...]:
    if isinstance(behavior, Speech):
        return ("start", *(mark.id for mark in sorted(behavior.marks, key=lambda mark: mark.position)), "end")
    return SEVEN if type_of(behavior) in HOLDS else ("start", "end")


def held_with_next(behavior: BlockBehavior) -> tuple[str, ...]:
    """Points that wait with the next hold point: a gaze is on target at once, and leaves at once."""
    type = type_of(behavior)
    if "relax" not in HOLDS.get(type, ()):
        return ()
    return ("stroke_end",) if type == "gaze" else ("ready", "stroke_start", "stroke_end")


def parts_of(behavior: BlockBehavior) -> tuple[str, ...]:
    if isinstance(behavior, Pointing | Gesture):
        return ARMS.get(behavior.mode, ("left_arm", "right_arm"))
    type = type_of(behavior)
    return (PART.get(type, "face" if type.startswith("face") else type),)


def natural_durations(behavior: BlockBehavior) -> tuple[Seconds, ...]:
    """Speech: a second between two points."""
    return DURATIONS.get(type_of(behavior), (1.0,) * (len(points_of(behavior)) - 1))


class Script(Struct):
    """What a behavior really does. durations: of its phases, where they differ from the estimate.

    slow: factor on all phases. stall: never gets to this point. fail: the body gives up on the way to it.
    """

    durations: tuple[Seconds, ...] = ()
    slow: float = 1.0
    stall: str = ""
    fail: str = ""
    refuse: bool = False
    infeasible: str = ""
    """Type of warning of the estimate."""
    deaf: bool = False
    """Does not even answer an abort."""


class Act(Struct, eq=False):
    perform: PerformBehavior
    changed: asyncio.Event
    task: asyncio.Task[None] | None = None
    passed: list[str] = field(default_factory=list)
    coming: list[str] = field(default_factory=list)
    """Points that it has come to and reports with the next one."""
    due: Seconds = inf
    """When it comes to its next point."""
    spoken: str = ""

    def covers(self, sync: str) -> bool:
        points = points_of(self.perform.behavior)
        return not self.perform.held and points.index(sync) <= points.index(self.perform.through)


class FakeBody:
    """scripts: by behavior id. estimates: durations it expects, by behavior id, where not natural.

    elastic: shortest and longest time of a phase, by its natural one. homing: seconds on the way home.
    pauses: the voice can wait at its marks.
    """

    def __init__(
        self,
        scripts: Mapping[str, Script] | None = None,
        estimates: Mapping[str, tuple[Seconds, ...]] | None = None,
        elastic: tuple[float, float] = (1.0, 1.0),
        homing: Seconds = 0.0,
        *,
        pauses: bool = False,
    ) -> None:
        self.pauses = pauses
        self.elastic = elastic
        self.homing = homing
        self.scripts = dict(scripts or {})
        self.estimates = dict(estimates or {})
        self.stops: list[str] = []
        """`behavior:sync` of each hold."""
        self.commands: list[tuple[Seconds, str, str]] = []
        """Time, behavior and authority of each command."""
        self.homes: list[tuple[str, ...]] = []
        self.aborted: list[str] = []
        self.acts: dict[str, Act] = {}
        self.asked = 0
        """How often for estimates."""

    async def serve(self, bus: Bus, ready: Ready) -> None:
        self.bus = bus
        self.desk = RequestDesk(bus, "control", self._cancelled)
        bus.answer(keys.ESTIMATE, self._estimate)
        try:
            with bus.subscribe(*RequestDesk.patterns("control")) as inbox:
                ready()
                async with asyncio.TaskGroup() as self.tasks:
                    async for received in inbox:
                        match self.desk.take(received):
                            case PerformBehavior() as perform:
                                self._perform(perform)
                            case Cancel(id=id):
                                self._abort(id)
                            case AbortBehavior() as abort:
                                self._abort_by_name(abort)
                            case GoHome(id=id, parts=parts):
                                self.desk.accept(id)
                                self.homes.append(parts)
                                self.tasks.create_task(self._home(id), name=f"fake home {id}")
        finally:
            self.desk.close()

    async def _home(self, id: str) -> None:
        await asyncio.sleep(self.homing)
        self.desk.end(HomeReached(id=id, at=self.bus.stamp()))

    def _abort_by_name(self, abort: AbortBehavior) -> None:
        for id, act in list(self.acts.items()):
            if (act.perform.block, act.perform.behavior.id) == (abort.block, abort.behavior):
                self._abort(id)
        self.desk.end(BehaviorAborted(id=abort.id))

    def _cancelled(self, cancel: Cancel) -> None:
        self._abort(cancel.id)

    def _script(self, behavior: BlockBehavior) -> Script:
        return self.scripts.get(behavior.id, Script())

    def estimate(self, behavior: BlockBehavior) -> Estimate:
        """What it answers when asked."""
        if kind := self._script(behavior).infeasible:
            return Estimate(behavior=behavior.id, feasible=False, warning=kind, fault=Fault(reason="no way"))
        durations = self.estimates.get(behavior.id, natural_durations(behavior))
        holds = self._holds(behavior)
        phases = tuple(
            Phase(
                since=since,
                to=to,
                shortest=seconds * self.elastic[0],
                natural=seconds,
                longest=seconds * self.elastic[1],
                hold=to in holds,
            )
            for (since, to), seconds in zip(pairwise(points_of(behavior)), durations, strict=True)
        )
        return Estimate(behavior=behavior.id, feasible=True, parts=parts_of(behavior), phases=phases)

    def _holds(self, behavior: BlockBehavior) -> tuple[str, ...]:
        if isinstance(behavior, Speech) and self.pauses:
            return tuple(mark.id for mark in behavior.marks)
        return HOLDS.get(type_of(behavior), ())

    def _estimate(self, question: Message) -> Message:
        assert isinstance(question, EstimateBehaviors)
        self.asked += 1
        return Estimates(items=tuple(self.estimate(item.behavior) for item in question.items))

    def _perform(self, perform: PerformBehavior) -> None:
        self.commands.append((self.bus.now(), perform.behavior.id, perform.through))
        if act := self.acts.get(perform.id):
            act.perform = perform
            act.changed.set()
            return
        if self._script(perform.behavior).refuse:
            self.desk.refuse(perform.id, Fault(reason="conflict", where=perform.behavior.id))
            return
        self.desk.accept(perform.id)
        self._take_over(perform)
        act = self.acts[perform.id] = Act(perform, asyncio.Event())
        act.task = self.tasks.create_task(self._run(act), name=f"fake {perform.id}")

    def _take_over(self, perform: PerformBehavior) -> None:
        """End whatever has a part of it. A shift and a look take nothing from each other: the look is on top."""
        type = type_of(perform.behavior)
        for other in list(self.acts.values()):
            theirs = type_of(other.perform.behavior)
            shared = set(parts_of(perform.behavior)) & set(parts_of(other.perform.behavior))
            if not shared or type == "speech" or (type in SHIFTS and theirs == "gaze"):
                continue
            assert other.task is not None
            other.task.cancel()
            self._pass_what_is_due(other)
            if theirs in SHIFTS and type == "gaze":
                self._pass(other, "end", self.bus.now())
            self._end(other, "done" if "end" in other.passed else "taken_over")

    async def _run(self, act: Act) -> None:
        behavior = act.perform.behavior
        script = self._script(behavior)
        self._reached(act, "start", self.bus.now())
        for seconds, sync in self._phases(behavior):
            if sync == script.stall:
                await asyncio.get_running_loop().create_future()
            await self._phase(act, sync, seconds)
            if sync == script.fail:
                self._end(act, "failed", Fault(reason="overheated"))
                return
            arrived = self.bus.now()
            if sync in self._holds(behavior) and not act.covers(sync):
                self._arrived(act, sync, arrived)
                while not act.covers(sync):
                    act.changed.clear()
                    await act.changed.wait()
            self._pass(act, sync, arrived)
        self._end(act, "done")

    def _phases(self, behavior: BlockBehavior) -> list[tuple[Seconds, str]]:
        """Seconds to each point, as it really does it; under a look a shift ends at once."""
        script = self._script(behavior)
        durations = script.durations or natural_durations(behavior)
        if type_of(behavior) in SHIFTS and any(type_of(act.perform.behavior) == "gaze" for act in self.acts.values()):
            durations = (0.0,)
        return [(each * script.slow, sync) for each, sync in zip(durations, points_of(behavior)[1:], strict=True)]

    def _pass(self, act: Act, sync: str, arrived: Seconds) -> None:
        """Report a point and those before it that wait with it, unless it is one of these itself."""
        act.coming.append(sync)
        behavior = act.perform.behavior
        if sync in held_with_next(behavior):
            return
        for each in act.coming:
            self._reached(act, each, arrived)
        act.coming = []
        if isinstance(behavior, Speech):
            position = next((mark.position for mark in behavior.marks if mark.id == sync), len(behavior.text))
            act.spoken = behavior.text[:position]

    def _pass_what_is_due(self, act: Act) -> None:
        """Report the points of this very instant to which it comes, before another behavior takes its part."""
        behavior, now = act.perform.behavior, self.bus.now()
        phases = self._phases(behavior)[len(act.passed) + len(act.coming) - 1 :] if act.passed else []
        for number, (seconds, sync) in enumerate(phases):
            is_due = act.due <= now if not number else not seconds
            is_faulty = sync in (self._script(behavior).stall, self._script(behavior).fail)
            if not is_due or is_faulty or (sync in self._holds(behavior) and not act.covers(sync)):
                return
            self._pass(act, sync, now)

    async def _phase(self, act: Act, sync: str, natural: Seconds) -> None:
        """As long as is natural, or as near to the planned instant as it can; a voice is silent while it is held."""
        began = self.bus.now()
        while True:
            held = act.perform.held
            if held and isinstance(act.perform.behavior, Speech):
                since = self.bus.now()
                act.changed.clear()
                await act.changed.wait()
                began += self.bus.now() - since
                continue
            # A shift under a look moves nothing: its end is whenever it is asked for.
            is_beneath = type_of(act.perform.behavior) in SHIFTS and not natural
            least, most = began + natural * self.elastic[0], inf if is_beneath else began + natural * self.elastic[1]
            planned = {} if held else {each.sync: self.bus.local(each.at) for each in act.perform.pace}
            until = act.due = min(max(planned[sync], least), most) if sync in planned else began + natural
            if until <= self.bus.now():
                return
            act.changed.clear()
            with suppress(TimeoutError):
                async with asyncio.timeout_at(until):
                    await act.changed.wait()

    def _arrived(self, act: Act, sync: str, at: Seconds) -> None:
        behavior = act.perform.behavior.id
        self.stops.append(f"{behavior}:{sync}")
        message = SyncPointArrived(
            id=act.perform.id, block=act.perform.block, behavior=behavior, sync=sync, at=self.bus.stamp(at)
        )
        self.bus.publish(keys.SYNC_POINT, message)

    def _reached(self, act: Act, sync: str, arrived: Seconds) -> None:
        act.passed.append(sync)
        message = SyncPointReached(
            id=act.perform.id,
            block=act.perform.block,
            behavior=act.perform.behavior.id,
            sync=sync,
            at=self.bus.stamp(),
            arrived=self.bus.stamp(arrived),
        )
        self.bus.publish(keys.SYNC_POINT, message)

    def _abort(self, id: str) -> None:
        if (act := self.acts.get(id)) is None:
            self.desk.refuse(id, Fault(reason="nothing to abort"))
            return
        if self._script(act.perform.behavior).deaf:
            return
        assert act.task is not None
        act.task.cancel()
        self.aborted.append(act.perform.behavior.id)
        self._end(act, "aborted")

    def _end(self, act: Act, status: str, fault: Fault | None = None) -> None:
        perform = act.perform
        del self.acts[perform.id]
        self.desk.end(
            BehaviorOutcome(
                id=perform.id,
                block=perform.block,
                behavior=perform.behavior.id,
                status=status,  # type: ignore[arg-type]
                at=self.bus.stamp(),
                passed=act.passed[-1] if act.passed else "",
                spoken=act.spoken,
                fault=fault,
            )
        )
