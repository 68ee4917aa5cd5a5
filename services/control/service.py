"""The service `control`: takes requests from the bus, has the body perform them, and publishes what it reports.

It decides nothing: `serving/intake.py` does. What comes from the bus, the desk, the driver and the clock is handed
there, one step at a time, and what comes out is carried out here.
"""

import asyncio
import logging
from collections.abc import Callable
from contextlib import aclosing, nullcontext
from functools import partial
from itertools import count
from math import inf

from msgspec import Struct
from msgspec.structs import replace

from engage_hri.schemas import keys
from engage_hri.schemas.body import BodyPose, JointAngle, RobotSeen, RobotState
from engage_hri.schemas.body_faults import BodyFault, SwitchFaults
from engage_hri.schemas.faults import Fault, InputRefused
from engage_hri.schemas.perception import SoundFrame
from engage_hri.schemas.recognition import SamePeople
from engage_hri.schemas.requests import Request
from engage_hri.schemas.units import Seconds
from engage_hri.schemas.world import COVERED_FOR, World
from engage_hri.services.bus import journal
from engage_hri.services.bus.interface import Bus, Received, is_asked_to_stop
from engage_hri.services.control.bases.drivers import made, with_settings_of_drivers
from engage_hri.services.control.config import ControlConfig
from engage_hri.services.control.contract.body import (
    BehaviorRefused,
    Body,
    BodyFailed,
    DriverBroken,
    Idle,
    MovementAuthority,
    Seen,
    Spoke,
    SpokenSound,
)
from engage_hri.services.control.contract.calibration import Calibration, calibrated
from engage_hri.services.control.contract.refusals import VOICE_ADVICE
from engage_hri.services.control.serving import steps
from engage_hri.services.control.serving.intake import ControlIntake
from engage_hri.services.control.serving.live_behavior import sound
from engage_hri.services.control.serving.questions import Questions
from engage_hri.services.requests.ends import RequestDesk
from engage_hri.services.runtime.intake import AnswerRequest, PublishMessage, input_of
from engage_hri.services.runtime.ledger import BusClock, NotedIntake
from engage_hri.services.runtime.loop import Timer
from engage_hri.services.runtime.service import Ready, tell_settings

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
        control = _Control(bus, config, body, tasks)
        with bus.subscribe(*RequestDesk.patterns("control"), keys.WORLD, keys.SAME_PEOPLE) as inbox:
            bus.answer(keys.ESTIMATE, control.questions.estimate)
            bus.answer(keys.DESCRIBE, control.questions.describe)
            tell_settings(bus, "control", told, config.files, covered_for=covered_for)
            ready()
            try:
                control.begin(covered_for)
                async for received in inbox:
                    with bus.containing(received):
                        control.take(received)
            finally:
                control.close()


class _Stream:
    """Stream of what a driver tells of one behavior, as long as somebody listens.

    authority: what the driver may do. is_revoked: the intake knows that it is to end. is_left: nobody listens any
    more. is_cut_off: the task was cancelled.
    """

    def __init__(self, authority: MovementAuthority) -> None:
        self.authority = authority
        self.task: asyncio.Task[None] | None = None
        self.is_revoked = self.is_left = self.is_cut_off = False

    def leave(self, *, is_cut_off: bool) -> None:
        """Listen no more. is_cut_off: the driver does not end by itself."""
        self.is_left, self.is_cut_off = True, is_cut_off
        if is_cut_off and self.task is not None:
            self.task.cancel()


class _Control:
    """Hands what `embody` receives, and what the driver tells, to the intake, and carries out what comes of it."""

    def __init__(self, bus: Bus, config: ControlConfig, body: Body, tasks: asyncio.TaskGroup) -> None:
        self.desk = RequestDesk(
            bus, "control", partial(self._serve, is_orphaned=True), on_extend=self._serve, on_hold=self._take,
            term=DEAD_MAN,
        )  # fmt: skip
        self._bus = bus
        self._body = body
        self._tasks = tasks
        self._intake = ControlIntake(bus.robot, config, bus.clock)
        self._timer = Timer(self._advance)
        self._steps = NotedIntake(bus, "control", self._intake, BusClock(bus), self._carry_out_safely)
        self._streams: dict[str, _Stream] = {}
        """Behaviors under way, by the names of their requests."""
        self._homeward: dict[str, asyncio.Task[None]] = {}
        """Tasks that take the body home, by the names of the requests for it."""
        self._looking_at = ""
        """What the eyes rest on, as the intake was told."""
        body.on_fault = lambda fault: self._take(steps.BodyComplained(fault))
        body.on_recovery = self._reassure
        body.on_sound = self._tell_sound
        body.wants_sound = partial(bus.is_heard, keys.ROBOT_SOUND)
        self._sounds = count()
        calibration = calibrated(body, config.calibration)
        self.questions = Questions(config, body, calibration, self._intake, self._warn)
        self._shown = Shown(bus, body, config.state_rate, self._note_eyes, calibration)

    def begin(self, covered_for: Seconds) -> None:
        """Tell that nothing goes on yet, and look at the body for the first time."""
        self._body.wants_sound()  # the bus looks from now on who listens
        begun = steps.ControlBegan(able=self._body.capabilities, covered_for=covered_for, faults=self._body.faults)
        self._take(begun)
        self._shown.look()

    def close(self) -> None:
        self.desk.close()
        self._shown.close()
        self._timer.set(None)

    # -- steps --------------------------------------------------------------------------------------------------

    def take(self, received: Received) -> None:
        """Take a message."""
        if isinstance(received.message, World | SamePeople):
            self._steps.take(input_of(received, received.message), received.number)
            self._timer.set(self._steps.deadline)
        elif (request := self.desk.take(received)) is not None:
            self._serve(request)

    def _serve(self, request: Request, *, is_orphaned: bool = False) -> None:
        """Hand over a request of the desk. is_orphaned: it is the end of one that has lost its requester."""
        with self.desk.serving(request):
            id = self.desk.asked(request.id).id
            handed = steps.RequestHanded(request=request, asked=id, is_orphaned=is_orphaned)  # type: ignore[arg-type]
            self._steps.take_own(handed)
        self._timer.set(self._steps.deadline)

    def _take(self, step: steps.ControlStep) -> None:
        """Take a step that comes by no bus."""
        with self._bus.containing(step):
            self._steps.take_own(step)
        self._timer.set(self._steps.deadline)
        if not isinstance(step, steps.ControlBegan | steps.EyesMoved):
            self._shown.look_soon()

    def _advance(self) -> None:
        with self._bus.containing("what is due by now"):
            self._steps.advance()
        self._timer.set(self._steps.deadline)

    def _carry_out_safely(self, output: Struct) -> None:
        """Carry out an effect. An error of a driver that it meets keeps none of the others from it."""
        with self._bus.containing(output, partial(self._undone, output)):
            self._carry_out(output)

    def _undone(self, output: Struct, fault: Fault) -> None:
        if isinstance(output, steps.BeginBehavior):
            self._take(steps.StreamEnded(request=output.request.id, how="broken", fault=fault))

    def _carry_out(self, output: Struct) -> None:
        match output:
            case PublishMessage(key=key, message=message):
                self._bus.publish(key, message)
            case AnswerRequest(answer=answer):
                self.desk.answer(answer)
            case steps.Alert(fault=fault):
                self._warn(fault)
            case steps.Reassure(text=text):
                self._reassure(text)
            case steps.ShowWorld(world=world):
                self._body.see(world)
                self._look()
                if self._body.state().moving:
                    self._shown.look_soon()
            case steps.PlayFaults(request=request, faults=faults):
                self._play(request, faults)
            case steps.BeginBehavior():
                self._begin(output)
            case steps.GiveAuthority(request=id, through=through, pace=pace):
                authority = self._streams[id].authority
                authority.set_pace({planned.sync: self._bus.local(planned.at) for planned in pace})
                authority.extend(through)
            case steps.HoldBehavior(request=id, is_held=is_held):
                authority = self._streams[id].authority
                authority.hold() if is_held else authority.go_on()
            case steps.RevokeAuthority(request=id, how=how):
                self._streams[id].is_revoked = True
                self._streams[id].authority.revoke(how)
            case steps.LeaveStream(request=id, is_cut_off=is_cut_off):
                self._streams[id].leave(is_cut_off=is_cut_off)
            case steps.TakeHome(request=id, parts=parts, why=why):
                way = self._tasks.create_task(self._go_home(id, parts, why), name=f"home {why}")
                if id:
                    self._homeward[id] = way
                    way.add_done_callback(lambda _: self._homeward.pop(id, None))
                self._shown.look_soon()
            case steps.StopHome(request=id):
                self._homeward[id].cancel()

    def _warn(self, fault: Fault) -> None:
        """Tell of something that a person has to see to: on the bus, in the log, and from the command that serves."""
        journal.alert(self._bus.log, "control: %s", fault)
        self._bus.publish(keys.fault("control"), fault)

    def _reassure(self, text: str) -> None:
        """Tell whoever sees the log that something is over of which it was warned."""
        journal.alert(self._bus.log, "control: %s", text)

    def _tell_sound(self, sound: SpokenSound) -> None:
        """Tell whoever listens what the voice is about to be heard of."""
        at = self._bus.stamp(sound.at)
        frame = SoundFrame(at=at, rate=sound.rate, samples=sound.samples, number=next(self._sounds))
        self._bus.publish(keys.ROBOT_SOUND, frame)

    # -- what the body does -------------------------------------------------------------------------------------

    def _begin(self, begun: steps.BeginBehavior) -> None:
        request = begun.request
        pace = {planned.sync: self._bus.local(planned.at) for planned in request.pace}
        stream = _Stream(MovementAuthority(request.behavior, request.through, pace))
        self._streams[request.id] = stream
        stream.authority.watch(lambda: self._note_revoked(request.id, stream))
        stream.task = self._tasks.create_task(self._perform(begun, stream), name=f"behavior {request.id}")

    def _note_revoked(self, id: str, stream: _Stream) -> None:
        """Take note that the body itself has revoked an authority."""
        if (how := stream.authority.revoked) is not None and not stream.is_revoked:
            stream.is_revoked = True
            self._take(steps.AuthorityRevoked(request=id, how=how))

    async def _perform(self, begun: steps.BeginBehavior, stream: _Stream) -> None:
        """Let the driver perform a behavior, and pass on what it tells."""
        id, label = begun.request.id, f"{begun.request.block}:{begun.request.behavior.id}"
        ended = steps.StreamEnded(request=id)
        try:
            async with aclosing(self._body.perform(begun.behavior, stream.authority)) as progress:
                async for told in progress:
                    if not stream.is_left:
                        self._note_progress(id, stream, told)
                    if stream.is_left:
                        break
        except BehaviorRefused as error:
            ended = steps.StreamEnded(request=id, how="refused", fault=error.fault)
        except DriverBroken as error:
            ended = steps.StreamEnded(request=id, how="broken", fault=error.fault)
        except BodyFailed as error:
            ended = steps.StreamEnded(request=id, how="failed", fault=error.fault)
        except (Exception, asyncio.CancelledError) as error:
            if is_asked_to_stop() and not stream.is_cut_off:
                raise
            fault = None if stream.is_cut_off else self._bus.failed(error, f"behavior {label}")
            ended = steps.StreamEnded(request=id, how="broken", fault=fault)
        del self._streams[id]
        self._look()
        self._take(ended)

    def _note_progress(self, id: str, stream: _Stream, told: object) -> None:
        progress = sound(told)
        self._steps.take_own(steps.BodyTold(request=id, progress=progress))  # an error in it ends this behavior
        self._timer.set(self._steps.deadline)
        self._shown.look_soon()
        if not stream.is_left and not isinstance(progress, steps.Nonsense | Spoke):
            self._look(id, progress.at)

    async def _go_home(self, id: str, parts: tuple[str, ...], why: str) -> None:
        """Take parts home, and say how that has ended. id: name of the request for it; empty: there is none."""
        ended = steps.HomeEnded(request=id, parts=parts)
        try:
            await self._body.home(parts)
        except BodyFailed as error:
            ended = steps.HomeEnded(request=id, parts=parts, fault=error.fault)
        except (Exception, asyncio.CancelledError) as error:
            if is_asked_to_stop():
                raise
            fault = self._bus.failed(error, f"way home {why}")
            ended = steps.HomeEnded(request=id, parts=parts, fault=fault, is_told=True)
        self._look()
        self._take(ended)

    def _play(self, request: SwitchFaults, faults: tuple[BodyFault, ...]) -> None:
        fault = None
        try:
            self._body.switch_faults(faults)
        except InputRefused as error:
            fault = error.fault
        except Exception as error:
            fault = self._bus.failed(error, request)
        played = steps.FaultsPlayed(request=request.id, by=request.requester, faults=self._body.faults, fault=fault)
        self._take(played)

    # -- what the eyes rest on ----------------------------------------------------------------------------------

    def _look(self, id: str = "", at: Seconds | None = None) -> None:
        """Look at what the eyes rest on. id: name of the request whose behavior has told of its progress, `at`."""
        with self._bus.containing("what the body looks at"):
            self._note_eyes(self._body.state().looking_at, id, at)

    def _note_eyes(self, on: str, id: str = "", at: Seconds | None = None) -> None:
        """Tell the intake what the eyes rest on, if that has changed."""
        if on != self._looking_at:
            self._looking_at = on
            self._take(steps.EyesMoved(on=on, at=self._bus.now() if at is None else at, request=id))


IDLE: Seconds = 1.0
"""Interval of `RobotState` messages while nothing moves."""
MOVING: Seconds = 0.25
"""Longest interval while anything moves. Whoever needs more listens to `keys.ROBOT_MOTION`."""
EPSILON: Seconds = 1e-6


class Shown:
    """Looks at the body many times a second while it moves, and tells what has changed.

    Whether somebody listens to `keys.ROBOT_MOTION` changes nothing else: the eyes are watched as often in any case.
    """

    def __init__(
        self,
        bus: Bus,
        body: Body,
        rate: float,
        on_look: Callable[[str], None],
        calibration: Calibration | None = None,
    ) -> None:
        """rate: looks a second while anything moves. on_look: told at each of them what the eyes rest on.

        calibration: says how far what is measured may be beside.
        """
        self._calibration = calibration or Calibration()
        self._bus = bus
        self._body = body
        self._on_look = on_look
        self._interval = 1.0 / rate
        self._next = Timer(self.look)
        self._looked: Seconds = -inf
        self._is_beside = False
        """True if it was told last that the body is elsewhere than it measures."""
        self._told: tuple[Seconds, tuple[str, str, bool]] = (-inf, ("", "", False))
        """Time of the last message on `keys.ROBOT_STATE`; what it looked at and said, and whether it moved."""

    def look(self) -> None:
        """Publish the state of the body, and set the timer for the next time: soon if the body moves."""
        self._next.set(self._bus.now() + IDLE)
        with self._bus.containing("the state of the body"):
            self._look()

    def _look(self) -> None:
        now, state = self._bus.now(), self._body.state()
        self._looked = now
        self._on_look(state.looking_at)
        widened = self._calibration.widened
        message = RobotState(
            at=self._bus.stamp(now), pose=state.pose, gaze=widened(state.gaze, "head"),
            left_arm=widened(state.left_arm, "left_arm"), right_arm=widened(state.right_arm, "right_arm"),
            looking_at=state.looking_at, speaking=state.speaking,
        )  # fmt: skip
        (at, before), news = self._told, (state.looking_at, state.speaking, state.moving)
        if news != before or now >= at + (MOVING if state.moving else IDLE) - EPSILON:
            self._told = now, news
            self._bus.publish(keys.ROBOT_STATE, message)
        self._tell_seen(now)
        wait = self._interval if state.moving else IDLE
        if self._bus.is_heard(keys.ROBOT_MOTION):
            idle = self._body.idle()
            self._bus.publish(keys.ROBOT_MOTION, self._with_idle(message, idle))
            if idle.added and not state.moving:
                wait = max(self._interval, min(MOVING, idle.quick_at - now))
        self._next.set(now + wait)

    def _with_idle(self, state: RobotState, idle: Idle) -> RobotState:
        """The state with what the body adds to it by itself."""
        if not idle.added:
            return state
        pose = BodyPose(
            joints=tuple([JointAngle(it.joint, it.angle + idle.added.get(it.joint, 0.0)) for it in state.pose.joints])
        )
        rays = {
            field: self._calibration.widened(self._body.ray_at(part, pose), part) or getattr(state, field)
            for field, part in (("gaze", "head"), ("left_arm", "left_arm"), ("right_arm", "right_arm"))
        }
        return replace(state, pose=pose, **rays)

    def _tell_seen(self, now: Seconds) -> None:
        """Publish where a simulated body really is, as long as that is not where it measures."""
        seen = self._body.seen()
        if seen is not None or self._is_beside:
            rays = seen or Seen()
            message = RobotSeen(
                at=self._bus.stamp(now), gaze=rays.gaze, left_arm=rays.left_arm, right_arm=rays.right_arm
            )
            self._bus.publish(keys.ROBOT_SEEN, message)
        self._is_beside = seen is not None

    def look_soon(self) -> None:
        """Bring the next look forward, as something has begun to move."""
        due = self._looked + self._interval
        if self._next.at is None or self._next.at > due:
            self._next.set(due)

    def close(self) -> None:
        """Look no more."""
        self._next.set(None)
