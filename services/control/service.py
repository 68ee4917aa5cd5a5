"""The service `control`: takes requests from the bus, has the body perform them, and publishes what it reports."""

import asyncio
import logging
from contextlib import aclosing, nullcontext
from functools import partial

from msgspec.structs import replace

from engage_hri.schemas import keys
from engage_hri.schemas.behaviors import Gaze, GazeShift, HeadDirectionShift
from engage_hri.schemas.body import (
    AbortBehavior,
    BehaviorAborted,
    BehaviorOutcome,
    GoHome,
    HomeReached,
    PerformBehavior,
    SyncPointArrived,
    SyncPointReached,
    WordSpoken,
)
from engage_hri.schemas.body_faults import SwitchFaults
from engage_hri.schemas.covered import COVERED_FOR, CoveredObjects
from engage_hri.schemas.faults import Fault
from engage_hri.schemas.holds import BodyHeld
from engage_hri.schemas.requests import Cancel, Request
from engage_hri.schemas.units import Seconds
from engage_hri.schemas.world import World
from engage_hri.services.bus.interface import Bus, Received, is_asked_to_stop
from engage_hri.services.control.bases.drivers import made, with_settings_of_drivers
from engage_hri.services.control.config import ControlConfig
from engage_hri.services.control.contract.body import (
    AbortMode,
    Arrived,
    BehaviorRefused,
    Body,
    BodyFailed,
    DriverBroken,
    MovementAuthority,
    Progress,
    Reached,
    Spoke,
    TakenOver,
)
from engage_hri.services.control.contract.calibration import calibrated
from engage_hri.services.control.contract.refusals import VOICE_ADVICE
from engage_hri.services.control.contract.variability import Deviations, is_lost
from engage_hri.services.control.serving.actions import ActionReporter
from engage_hri.services.control.serving.behavior_task import Performing
from engage_hri.services.control.serving.dead_man import Unheard
from engage_hri.services.control.serving.fault_switch import FaultSwitch
from engage_hri.services.control.serving.live_behavior import LiveBehavior
from engage_hri.services.control.serving.questions import Questions
from engage_hri.services.control.serving.state_publisher import Shown
from engage_hri.services.control.serving.warnings_told import recovered, warn
from engage_hri.services.requests.ends import RequestDesk
from engage_hri.services.requests.serving_effects import Hold
from engage_hri.services.runtime.service import Ready
from engage_hri.services.runtime.settings import tell_settings

DEAD_MAN: Seconds = 5.0
"""Time without a message of the requester after which its behaviors end, unless the request names a lease
(`Request.lease`). After the last one the body goes home. Longer than two repetitions, one every 2 s. Ours."""


async def embody(
    bus: Bus,
    ready: Ready,
    config: ControlConfig,
    body: Body | None = None,
    *,
    covered_for: Seconds = COVERED_FOR,
    connects: bool = True,
) -> None:
    """Serve until cancelled.

    body: the one of the configuration unless given. covered_for: see `CoveredObjects`.
    connects: False where nothing is to move, and the body is asked for estimates alone.

    Raises InputRefused or RunFailed: there is no such body, or it cannot be had.
    """
    told = config
    if body is None:
        body, told = made(config), with_settings_of_drivers(config)
    if "speech" not in body.capabilities.types:
        # Whoever starts it is to see this, whatever the log shows.
        logging.getLogger("engage").warning(
            "control: the body %s has no voice: %s", body.capabilities.body, VOICE_ADVICE
        )
    async with body.connected() if connects else nullcontext(), asyncio.TaskGroup() as tasks:
        control = _Control(bus, config, body, tasks, CoveredObjects(covered_for))
        with bus.subscribe(*RequestDesk.patterns("control"), keys.WORLD) as inbox:
            bus.answer(keys.ESTIMATE, control.questions.estimate)
            bus.answer(keys.DESCRIBE, control.questions.describe)
            tell_settings(bus, "control", told, config.files, covered_for=covered_for)
            ready()
            try:
                control.tell_held()
                control.switch.tell()
                control.shown.begin()
                async for received in inbox:
                    with bus.containing(received):
                        control.take(received)
            finally:
                control.close()


class _Control:
    """State of the service, and what it does with each message that `embody` receives."""

    def __init__(
        self, bus: Bus, config: ControlConfig, body: Body, tasks: asyncio.TaskGroup, objects: CoveredObjects
    ) -> None:
        self._live: dict[str, LiveBehavior] = {}
        self._unheard = Unheard()
        self.desk = RequestDesk(
            bus, "control", self._requester_lost, on_extend=self.serve, on_hold=self._hold, term=DEAD_MAN
        )
        self._bus = bus
        self._config = config
        self._body = body
        self._tasks = tasks
        self._actions = ActionReporter(bus.robot, bus.clock)
        self._world = World(entities=())
        self._objects = objects
        self._homeward: dict[str, asyncio.Task[None]] = {}
        """Tasks that take the body home, by the id of the request that asked for it."""
        self._sent = 0
        self._has_not_come_home = False
        """A way home has failed, and none of the whole body has come to its end since."""
        body.on_fault = self._tell_fault
        body.on_recovery = partial(recovered, bus)
        calibration = calibrated(body, config.calibration)
        self.questions = Questions(bus, config, body, calibration, lambda: self._world)
        self.shown = Shown(bus, body, self._actions, config.state_rate, calibration)
        self.switch = FaultSwitch(bus, body, self.desk)

    # -- requests -----------------------------------------------------------------------------------------------

    def take(self, received: Received) -> None:
        if isinstance(received.message, World):
            self.see(received.message)
        elif (request := self.desk.take(received)) is not None:
            with self.desk.serving(request):
                self.serve(request)

    def see(self, world: World) -> None:
        self._world = self._objects.see(world, self._bus.now())
        self._body.see(self._world)
        self.note_look()
        if self._body.state().moving:
            self.shown.look_soon()

    def serve(self, request: Request) -> None:
        """Serve a request that is new, or that changes a live one."""
        live = self._live.get(request.id)
        match request:
            case PerformBehavior() if live is not None:
                self._extend(live, request)
            case PerformBehavior():
                self._begin(request)
            case AbortBehavior():
                self._abort(request)
            case SwitchFaults():
                self.switch.serve(request)
                self.shown.look_soon()
            case Cancel() if live is not None:
                live.stop(request.fault(live.request.behavior.id))
                self._revoke(live)
            case GoHome():
                self.desk.accept(request.id)
                way = self._tasks.create_task(self._go_home(request), name=f"home {request.id}")
                self._homeward[request.id] = way
                way.add_done_callback(lambda _: self._homeward.pop(request.id, None))
            case Cancel(id=id) if id in self._homeward:
                self._homeward[id].cancel()
                self.desk.refuse(id, request.fault(id).following("given up on the way home", id))

    def _begin(self, request: PerformBehavior) -> None:
        refused = self.questions.refused(request.behavior)  # before a motor sees it
        if refused is not None and refused.fault is not None:
            self.desk.refuse(request.id, refused.fault)
            return
        try:
            authority = MovementAuthority(request.behavior, request.through, self._pace(request))
        except ValueError as error:
            self.desk.refuse(request.id, Fault(reason=str(error), where=request.behavior.id, service="control"))
            return
        id = self.desk.asked(request.id).id
        live = self._live[request.id] = LiveBehavior(request, id, authority)
        self._tasks.create_task(self._perform(live), name=f"behavior {request.id}")

    def _abort(self, request: AbortBehavior) -> None:
        """End every live behavior of that name, whichever requester has asked for it."""
        label = f"{request.block}:{request.behavior}"
        meant = [live for live in self._live.values() if live.label == label]
        if not meant:
            self.desk.refuse(request.id, Fault(reason="no such behavior", where=label, service="control"))
            return
        self.desk.accept(request.id)
        for live in meant:
            why = Fault(
                reason="aborted on request", where=request.behavior, cause="cancelled", whose=request.requester
            )
            live.stop(why)
            self._revoke(live, request.how)
            live.aborts.append(request.id)

    def _revoke(self, live: LiveBehavior, how: AbortMode = "relax") -> None:
        """Revoke the authority of a behavior. An error of a driver that watches it is contained."""
        with self._bus.containing(f"the end of behavior {live.label}"):
            live.authority.revoke(how)

    def _pace(self, request: PerformBehavior) -> dict[str, Seconds]:
        return {planned.sync: self._bus.local(planned.at) for planned in request.pace}

    def _extend(self, live: LiveBehavior, request: PerformBehavior) -> None:
        if request.held:
            live.hold(True)
        live.authority.set_pace(self._pace(request))
        try:
            live.authority.extend(request.through)
        except ValueError as error:
            where = live.request.behavior.id
            self._bus.publish(keys.fault("control"), Fault(reason=str(error), where=where, service="control"))
        if not request.held:
            live.hold(False)

    async def _perform(self, live: LiveBehavior) -> None:
        """Perform a behavior, from its request to the one terminal answer."""
        request, accepted = live.request, False
        performing = Performing(live, self._body, self._give_up)
        try:
            async with performing, aclosing(performing.progress()) as stream:
                async for progress in stream:
                    if not accepted:
                        self.desk.accept(request.id)
                        accepted = True
                    self._report(live, progress)
        except BehaviorRefused as error:
            self._forget(live)
            self.desk.refuse(request.id, error.fault)
            self._end_aborts(live)
            return
        except (Exception, asyncio.CancelledError) as error:
            if is_asked_to_stop() and not performing.is_broken_off:
                raise
            live.status = "failed"
            if isinstance(error, BodyFailed):
                live.fault = error.fault
            elif live.fault is None:
                live.fault = self._bus.failed(error, f"behavior {live.label}")
            if isinstance(error, DriverBroken) or not isinstance(error, BodyFailed):
                self._take_home(f"after {live.label} broke")  # nobody knows where its parts are
        if live.status == "aborted":
            live.status, live.fault = live.aborted, live.why
            if live.authority.revoked == "taken_over":
                reason, by = "another behavior took its part", request.requester
                live.status = "taken_over"
                live.fault = Fault(reason=reason, where=request.behavior.id, cause="replaced", whose=by)
        self._finish(live)

    def _give_up(self, live: LiveBehavior) -> None:
        """End a behavior without its driver, which does not end it."""
        live.status = "failed"
        self._finish(live)
        self._take_home(f"after {live.label} was given up")

    def _finish(self, live: LiveBehavior) -> None:
        if live.request.id in self._live:
            self._forget(live)
            with self.desk.serving(live.request):
                self._end(live)
            self._end_aborts(live)

    def _forget(self, live: LiveBehavior) -> None:
        del self._live[live.request.id]
        if self._unheard.forget(live):
            self.tell_held()

    def _end(self, live: LiveBehavior) -> None:
        request, at = live.request, self._bus.now()
        self.shown.tell(self._actions.ended(request.id, at))
        self.note_look()
        self.shown.look_soon()
        outcome = BehaviorOutcome(
            id=request.id, block=request.block, behavior=request.behavior.id, status=live.status,
            at=self._bus.stamp(at), passed=live.passed, spoken=live.spoken, fault=live.fault,
        )  # fmt: skip
        self.desk.end(outcome)

    def _end_aborts(self, live: LiveBehavior) -> None:
        """Answer the abort requests that waited for this behavior and wait for no other one."""
        awaited = {id for other in self._live.values() for id in other.aborts}
        for id in live.aborts:
            if id not in awaited:
                self.desk.end(BehaviorAborted(id=id))

    async def _go_home(self, request: GoHome) -> None:
        with self.desk.serving(request):
            if (fault := await self._homed(request.parts)) is not None:
                self.desk.refuse(request.id, replace(fault, whose=request.requester) if fault.cause else fault)
                return
            self.note_look()
            self.desk.end(HomeReached(id=request.id, at=self._bus.stamp()))

    async def _homed(self, parts: tuple[str, ...] = ()) -> Fault | None:
        """Take parts home. Returns what has gone wrong, which has been told."""
        try:
            await self._body.home(parts)
        except BodyFailed as error:
            if not isinstance(error, TakenOver):
                self._tell_fault(error.fault)
                self._has_not_come_home = True
            return error.fault
        if self._has_not_come_home and not parts:
            self._has_not_come_home = False
            recovered(self._bus, "the body is at home")
        return None

    def _take_home(self, name: str) -> None:
        """Move the whole body home without a request."""

        async def go() -> None:
            with self._bus.containing(f"way home {name}"):
                await self._homed()

        self._tasks.create_task(go(), name=f"home {name}")
        self.shown.look_soon()

    # -- reports ------------------------------------------------------------------------------------------------

    def _report(self, live: LiveBehavior, progress: Progress) -> None:
        request = live.request
        id, block, behavior, requester = live.id, request.block, request.behavior.id, request.requester
        at = self._bus.stamp(progress.at)
        match progress:
            case Arrived(sync=sync):
                self._tell(
                    SyncPointArrived(id=id, block=block, behavior=behavior, sync=sync, at=at, requester=requester)
                )
                self.note_look(live, progress.at)
            case Reached(sync=sync):
                came = self._bus.stamp(progress.arrived)
                reached = SyncPointReached(
                    id=id, block=block, behavior=behavior, sync=sync, at=at, arrived=came, requester=requester
                )
                self._tell(reached)
                live.passed = sync
                live.status = "done" if sync == "end" else live.status
                self.shown.tell(self._actions.reached(request.id, live.label, request.behavior, progress))
                self.note_look(live, progress.at)
            case Spoke(word=word, position=position):
                live.position = int(position)  # a driver's number, of whatever type
                self._tell(WordSpoken(block=block, behavior=behavior, word=word, position=position, at=at))
        self.shown.look_soon()

    def _tell(self, message: SyncPointArrived | SyncPointReached | WordSpoken) -> None:
        self._sent += 1
        on = Deviations(self._config.variability.seed, self._body.faults)
        if not is_lost(on, self._sent, message.at.seconds):
            self._bus.publish(keys.SYNC_POINT, message)

    def note_look(self, live: LiveBehavior | None = None, at: Seconds | None = None) -> None:
        """Publish what the eyes rest on, if that has changed."""
        of_head = live is not None and isinstance(live.request.behavior, Gaze | GazeShift | HeadDirectionShift)
        label = live.label if live is not None and of_head else ""
        self.shown.note_look(label, at)

    def _tell_fault(self, fault: Fault) -> None:
        """Publish what went wrong with the body outside of any behavior."""
        warn(self._bus, fault)
        self.shown.look_soon()

    # -- dead man -----------------------------------------------------------------------------------------------

    def _hold(self, hold: Hold) -> None:
        """Hold a behavior that nobody renews, or let it go on."""
        if (live := self._live.get(hold.name)) is None:
            return
        self._unheard.let_go(live)
        if hold.until is not None:
            self._unheard.hold(live, self._bus.stamp(), self._bus.stamp(hold.until), hold.why)
        self.tell_held()

    def tell_held(self) -> None:
        """Publish what waits since nobody renews it."""
        self._bus.publish(keys.BODY_HELD, BodyHeld(at=self._bus.stamp(), holds=self._unheard.holds))

    def _requester_lost(self, cancel: Cancel) -> None:
        """Revoke a behavior that has lost its requester. With the last one of that requester the body goes home."""
        live = self._live.get(cancel.id)
        if live is None:
            return
        live.stop(cancel.fault(live.label), "lapsed")
        self._revoke(live)
        others = (each for each in self._live.values() if each.request.requester == cancel.requester)
        if all(each.authority.revoked for each in others):
            why = cancel.fault("")
            warn(self._bus, replace(why, reason=f"{why.reason}; the body goes home", service="control"))
            self._take_home(f"after {cancel.requester}")

    def close(self) -> None:
        self.desk.close()
        self.shown.close()
