"""The generation service: takes fragments and what is perceived; sends blocks, outcomes and the owner of the head."""

import asyncio
from collections.abc import Iterable
from typing import Literal

from msgspec.structs import replace

from engage_hri.schemas import keys
from engage_hri.schemas.actions import ActionBegan, ActionEnded, ActorFound, ActorLost
from engage_hri.schemas.attention import HeadOwner, Inhibit, InhibitionEnded
from engage_hri.schemas.blocks import BlockOutcome, PerformBlock
from engage_hri.schemas.body import RobotState, WordSpoken
from engage_hri.schemas.conditions import ConditionSet, SetCondition, StudyCondition
from engage_hri.schemas.covered import COVERED_FOR, CoveredObjects
from engage_hri.schemas.faults import EngageError, Fault, InputRefused
from engage_hri.schemas.feedback import SyncPointProgress, WarningFeedback, WarningKind
from engage_hri.schemas.fragments import PerformFragment
from engage_hri.schemas.perception import Utterance
from engage_hri.schemas.presence import PeerAlive, PeerGone
from engage_hri.schemas.recognition import ConnectionEvent, Statistics, session_of
from engage_hri.schemas.requests import ORPHANING, Cancel, Request, Unreadable
from engage_hri.schemas.units import Seconds, Stamp
from engage_hri.schemas.world import World
from engage_hri.services.bus.interface import Bus, Received
from engage_hri.services.generation.config import GenerationConfig
from engage_hri.services.generation.fragment_check import lacks_people
from engage_hri.services.generation.fragment_runner import FragmentRunner
from engage_hri.services.generation.head.arbiter import Arbiter, Shift
from engage_hri.services.generation.head.inhibitions import Leases
from engage_hri.services.reports.action_reports import REPORT_GRACE, ActionReports
from engage_hri.services.reports.publisher import Publisher
from engage_hri.services.reports.reports import GoesOn, Told
from engage_hri.services.reports.world_report import WorldReport
from engage_hri.services.requests.deadlines import Silences
from engage_hri.services.requests.ends import RequestDesk, Requester
from engage_hri.services.runtime.service import Ready
from engage_hri.services.runtime.settings import tell_settings

WORLD_PATIENCE: Seconds = 5.0
"""Time that a fragment waits for a first report of the world, or for a person to speak to: cameras start as the robot
does. Ours."""
NAME = "generation"
PATTERNS = (
    *RequestDesk.patterns(NAME), keys.ANY_REQUEST_STATE, keys.FEEDBACK, keys.ANY_CONNECTION_EVENT, keys.WORLD,
    keys.SYNC_POINT, keys.ANY_ACTION, keys.ANY_PERCEIVED_ONGOING, keys.UTTERANCE, keys.ROBOT_STATE,
    keys.ANY_STATISTICS,
)  # fmt: skip


async def generate(bus: Bus, ready: Ready, config: GenerationConfig, *, covered_for: Seconds = COVERED_FOR) -> None:
    """Serve until cancelled. A bad fragment is refused with a fault; it never ends the service.

    covered_for: see `CoveredObjects`.
    """
    with bus.subscribe(*PATTERNS) as inbox:
        generation = _Generation(bus, config, CoveredObjects(covered_for))
        try:
            async with asyncio.TaskGroup() as tasks:
                tasks.create_task(generation.perform(), name="fragments")
                tasks.create_task(generation.keep_deadlines(), name="deadlines")
                generation.tell_condition()
                tell_settings(bus, "generation", config, covered_for=covered_for)
                ready()
                async for received in inbox:
                    with bus.containing(received):
                        generation.take(received)
        finally:
            generation.close()


class _Generation:
    """The service's state: feeds messages to the policies and publishes what they decide."""

    def __init__(self, bus: Bus, config: GenerationConfig, objects: CoveredObjects) -> None:
        self._bus = bus
        self._config = config
        self._desk = RequestDesk(bus, NAME, self._cancel)
        self._requests = Requester(bus)
        self._arbiter = Arbiter(bus.robot, config)
        self._leases = Leases(config)
        self._runner = FragmentRunner(
            bus, config, self._desk, self._requests, self._arbiter, self._leases, self._after
        )
        self._objects = objects
        self._reports = ActionReports(bus.robot, REPORT_GRACE, bus.clock, self._instant)
        self._perception = Publisher()
        self._seen = WorldReport(REPORT_GRACE)
        self._early: dict[str, PerformFragment] = {}
        """Fragments that wait for a report of the world, or for a person, by request id."""
        self._patience = Silences[str](bus.sight)
        """Times until which they do."""
        self._changed = asyncio.Event()
        self._session = f"{bus.name}@{bus.now():.6f}"
        """Part of each request id, so that the ids differ after a restart."""

    def close(self) -> None:
        self._requests.close()
        self._desk.close()

    # -- what arrives ---------------------------------------------------------------------------------------------

    def take(self, received: Received) -> None:
        now = self._bus.now()
        self._requests.feed(received)
        message = received.message
        if self._perception.feed(message):
            self._admit_early(now)
        key, source, life = received.key, received.source, received.life
        self._observe(self._reports.take(message, key, source, life, now, past=received.past))
        if (seen := self._seen.take(message, source, life, now)) is not None and seen is not message:
            self._arbiter.feed((self._objects.at(now) if seen.entities else None) or seen, now)
        if (request := self._desk.take(received)) is not None:
            with self._desk.serving(request):
                self._serve(request, now)
        match message:
            case World():
                self._perception.published(received.source, received.life)
                world = self._objects.see(message, now)
                self._runner.feed(world, now)
                self._arbiter.feed(world, now)
                self._admit_early(now)
            case ConnectionEvent():
                self._runner.feed(message, now)
                if not message.retold:
                    self._arbiter.feed(message, now)
            case Utterance():
                if message.actor != self._bus.robot:
                    self._runner.feed(message, now)
            case RobotState() | Statistics():
                self._arbiter.feed(message, now)
            case SyncPointProgress() | WordSpoken():
                self._runner.feed(message, now)
            case Unreadable(block=block, fault=fault):
                self._warn(block, "PARSING_FAILURE", fault.within(block))
            case PeerGone(participant="control"):
                self._runner.body_lost()
                self._arbiter.body_lost()
            case PeerGone(participant="realizer"):
                self._arbiter.body_lost()
            case PeerGone(participant="recognition"):
                self._runner.recognition_gone(now)
                self._arbiter.recognition_lost()
            case PeerAlive(participant="recognition", run=run):
                self._runner.recognition_there(session_of(run))
        self._after(now)

    def _observe(self, told: Iterable[Told]) -> None:
        """Take what somebody does, or did while nobody told of it."""
        now = self._bus.now()
        for observation, _, _ in told:
            match observation:
                case ActionBegan() | ActionEnded():
                    self._runner.feed(observation, now)
                    if observation.actor != self._bus.robot:
                        self._arbiter.feed(observation, now)
                case ActorFound() | ActorLost():
                    self._arbiter.feed(observation, now)
                case GoesOn(began=began) if began.actor != self._bus.robot:
                    self._arbiter.feed(began, now)  # its beginning is no news: it answers nothing

    def _instant(self, stamp: Stamp) -> Seconds:
        return min(self._bus.local(stamp), self._bus.now())

    def _serve(self, request: Request, now: Seconds) -> None:
        match request:
            case PerformFragment():
                self._admit(request, now)
                if request.id in self._early:
                    self._patience.set(request.id, now + WORLD_PATIENCE)
            case Inhibit():
                self._grant(request, now)
            case SetCondition():
                self._set_condition(request)
            case Cancel():
                self._cancel(request)

    def _admit(self, request: PerformFragment, now: Seconds, *, may_wait: bool = True) -> None:
        """Hand a fragment to the runner, or keep it while the world lacks what it needs."""
        world = self._world(now)
        if (full := self._runner.full(len(self._early), request.fragment.id)) is not None:
            self._desk.refuse(request.id, full)  # nobody else is told: there may be thousands
            return
        try:
            if world is None or (may_wait and lacks_people(request.fragment, world)):
                self._early[request.id] = request
            else:
                self._runner.admit(request, world)
        except EngageError as error:
            self._refuse(request.id, error.fault)
            id = request.fragment.id
            self._warn(id, "PARSING_FAILURE", error.fault.within(id))

    def _admit_early(self, now: Seconds) -> None:
        """Try again with the fragments that wait, now that the world is known or has changed."""
        early, self._early = self._early, {}
        for request in early.values():
            with self._desk.serving(request):
                self._admit(request, now)

    def _world(self, now: Seconds) -> World | None:
        """The world as it probably is; None if it was never reported, or whoever reported it has gone."""
        return self._objects.at(now) if self._perception.is_there else None

    def _grant(self, request: Inhibit, now: Seconds) -> None:
        world = self._world(now)
        try:
            if request.target and world is not None and world.entity(request.target) is None:
                raise InputRefused(Fault(reason=f"the world does not know {request.target!r}", where=request.id))
            self._leases.take(request)
        except EngageError as error:
            self._leases.release(request.id)
            self._refuse(request.id, error.fault)
        else:
            self._desk.accept(request.id)

    def _set_condition(self, request: SetCondition) -> None:
        self._leases.speech_only = request.speech_only
        self._desk.accept(request.id)
        self.tell_condition(request.name, request.by or request.requester)
        self._desk.end(ConditionSet(id=request.id, name=request.name, speech_only=request.speech_only))

    def tell_condition(self, name: str = "", by: str = "") -> None:
        """Publish the condition that begins now."""
        told = StudyCondition(at=self._bus.stamp(), name=name, speech_only=self._leases.speech_only, by=by)
        self._bus.publish(keys.STUDY_CONDITION, told)

    def _refuse(self, id: str, fault: Fault) -> None:
        self._desk.refuse(id, fault)
        self._bus.publish(keys.fault(NAME), fault)

    def _warn(self, fragment: str, kind: WarningKind, message: str) -> None:
        """Publish a warning of a fragment. fragment: its id; empty if that could not be read."""
        self._bus.publish(keys.FRAGMENT_FEEDBACK, WarningFeedback(block=fragment or None, kind=kind, message=message))

    def _cancel(self, cancel: Cancel) -> None:
        """End a lease or a fragment: its requester asked for that, is gone, or has not renewed it."""
        now = self._bus.now()
        if self._leases.release(cancel.id):
            self._desk.end(InhibitionEnded(id=cancel.id, reason=_how(cancel)))
        elif self._early.pop(cancel.id, None):
            self._desk.refuse(cancel.id, cancel.fault(cancel.id))
        else:
            self._runner.cancel(cancel.id, cancel.fault(cancel.id), now)
        self._after(now)

    async def perform(self) -> None:
        """Fragments, as they come."""
        await self._runner.perform_in_order()

    # -- time -----------------------------------------------------------------------------------------------------

    async def keep_deadlines(self) -> None:
        """Ask the policies again when the earliest of their deadlines has come."""
        while True:
            self._changed.clear()
            try:
                async with asyncio.timeout_at(self._deadline()):
                    await self._changed.wait()
            except TimeoutError:
                with self._bus.containing("what is due by now"):
                    self._after(self._bus.now())

    def _deadline(self) -> Seconds | None:
        reports = (self._reports.deadline, self._seen.deadline)
        due = (self._runner.deadline, self._arbiter.deadline, self._patience.earliest, *reports)
        return min((each for each in due if each is not None), default=None)

    def _after(self, now: Seconds) -> None:
        """Settle what has become due by now; called after every message and at every deadline."""
        self._observe(self._reports.advance(now))
        if (seen := self._seen.advance(now)) is not None:
            self._arbiter.feed(seen, now)
        while (id := self._patience.due(now)) is not None:
            if (request := self._early.pop(id, None)) is None:
                continue
            if self._world(now) is not None:
                self._admit(request, now, may_wait=False)  # refuses it for the missing person
                continue
            since, name = now - WORLD_PATIENCE, self._perception.name or "perception"
            fault = self._bus.sight.misses(name, id, since, now).following("the world is unknown", id)
            self._refuse(id, replace(fault, advice="is perception running?"))
            self._runner.refused(request, fault, now)
        for id, fault in self._runner.settle(now):
            self._refuse(id, fault)
        self._rule(now)
        self._changed.set()

    # -- the head -------------------------------------------------------------------------------------------------

    def _rule(self, now: Seconds) -> None:
        self._arbiter.inhibit(self._leases.inhibition)
        ruling = self._arbiter.rule(now)
        if ruling.changed:
            since = self._bus.stamp(ruling.since)
            self._bus.publish(keys.HEAD_OWNER, HeadOwner(owner=ruling.owner, since=since, waiting=ruling.waiting))
        if ruling.shift is not None:
            self._send(ruling.shift)

    def _send(self, shift: Shift) -> None:
        id = f"{self._session}/{shift.id}"
        pending = self._requests.send(keys.BLOCK, PerformBlock(id=id, block=shift.block))

        def ended(outcome: "asyncio.Future[object]") -> None:
            if outcome.cancelled():
                return
            result = outcome.result() if outcome.exception() is None else None
            if not (isinstance(result, BlockOutcome) and result.status == "done"):
                self._arbiter.shift_failed(shift.id, self._bus.now())
                self._changed.set()

        pending.outcome.add_done_callback(ended)  # type: ignore[arg-type]


def _how(cancel: Cancel) -> Literal["lapsed", "released", "owner_lost"]:
    """Tell how an inhibition ends that is cancelled so."""
    if cancel.cause == "unrenewed":
        return "lapsed"
    return "owner_lost" if cancel.cause in ORPHANING - {"closed"} else "released"
