"""Generation between bus and policies, pure: what comes in, what is to be published, answered, sent and asked out.

    intake = GenerationIntake("robot", config, clock, session="7a4d6501")
    outputs = intake.take(input, now)           # a message, of which `reads` is true; a request; news of an own one
    outputs = intake.advance(now)               # whenever `deadline` has been reached

Given the same inputs in the same order, at the same instants and by the same clocks, the outputs are the same. So
nothing in here reads a clock, waits, or asks anybody by itself (services/runtime/intake.py says why).
"""

from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from typing import Literal, TypeGuard, get_args

from msgspec import Struct
from msgspec.structs import replace

from engage_hri.schemas import keys
from engage_hri.schemas.blocks import BlockOutcome, PerformBlock, SyncPointProgress, WarningFeedback, WarningKind
from engage_hri.schemas.body import RobotState, WordSpoken
from engage_hri.schemas.faults import EngageError, Fault, InputRefused
from engage_hri.schemas.fragments import (
    ConditionSet,
    HeadOwner,
    Inhibit,
    InhibitionEnded,
    PerformFragment,
    SetCondition,
    StudyCondition,
)
from engage_hri.schemas.participants import PeerAlive, PeerGone
from engage_hri.schemas.perception import ActionBegan, ActionEnded, ActorFound, ActorLost, OngoingActions, Utterance
from engage_hri.schemas.recognition import ConnectionEvent, Floor, Interjection, SamePeople, Statistics, session_of
from engage_hri.schemas.requests import ORPHANING, Accepted, Cancel, Refused, Unreadable, kind_of
from engage_hri.schemas.units import Seconds, Stamp
from engage_hri.schemas.world import COVERED_FOR, CoveredObjects, World
from engage_hri.services.bus.deadlines import Sight, Silences
from engage_hri.services.generation.config import GenerationConfig
from engage_hri.services.generation.exchange import (
    NAME,
    AnswerCame,
    CancelRequest,
    GenerationBegan,
    OwnSight,
    SendRequest,
)
from engage_hri.services.generation.fragment_check import lacks_people
from engage_hri.services.generation.fragments import Fragments
from engage_hri.services.generation.head.arbiter import Arbiter, Shift, SignOrder
from engage_hri.services.generation.inhibitions import Leases
from engage_hri.services.generation.policies import Policies
from engage_hri.services.reports.action_reports import REPORT_GRACE, ActionReports
from engage_hri.services.reports.in_force import Publisher, WorldReport
from engage_hri.services.reports.ongoing_actions import GoesOn, TimedReport
from engage_hri.services.reports.same_people import PeopleNames
from engage_hri.services.runtime.intake import AnswerRequest, Input, MachineClocks, PublishMessage, TellMistake
from engage_hri.services.text.own_words import OwnWords

WORLD_PATIENCE: Seconds = 5.0
"""Time that a fragment waits for a first report of the world, or for a person to speak to: cameras start as the robot
does. Ours."""

Told = (
    ActionBegan | ActionEnded | ActorFound | ActorLost | OngoingActions | World | RobotState | Statistics
    | ConnectionEvent | Floor | Interjection | Utterance | SyncPointProgress | WordSpoken | Unreadable | PeerAlive
    | PeerGone | SamePeople
)  # fmt: skip
"""Messages that generation takes into account, besides requests."""
Asked = PerformFragment | Inhibit | SetCondition | Cancel
"""Requests that it serves."""
Content = Told | Asked | AnswerCame | GenerationBegan | OwnSight
_TOLD = get_args(Told)


def reads(message: object) -> TypeGuard[Told]:
    """True for a message that generation takes into account, and that is no request."""
    return isinstance(message, _TOLD)


class GenerationIntake:
    """All of generation but its requests' lives.

    session: part of the ids of what it sends, of this life alone. policies: of installed packages.
    """

    def __init__(
        self,
        robot: str,
        config: GenerationConfig,
        clock: MachineClocks,
        session: str,
        policies: Policies = Policies(),  # noqa: B008
    ) -> None:
        self._robot = robot
        self._clock = clock
        self._session = session
        self._now: Seconds = 0.0
        self._outputs: list[Struct] = []
        self._own_sight = OwnSight()
        self._sight = Sight(NAME, lambda: self._own_sight.unlinked_at)
        self._arbiter = Arbiter(robot, config, policies.head)
        self._shifts: dict[str, str] = {}
        """Gaze shifts of the arbiter under way, by the id of their request."""
        self._leases = Leases(config)
        self._fragments = Fragments(
            robot,
            config,
            clock,
            session,
            self._sight,
            self._arbiter,
            self._leases,
            self._outputs.append,
            policies.turns,
        )
        self._objects = CoveredObjects(COVERED_FOR)
        self._own_words = OwnWords()
        """Words of the robot, which are nobody's when they are heard back."""
        self._reports = ActionReports(robot, REPORT_GRACE, clock.name, self._instant)
        self._perception = Publisher()
        self._seen = WorldReport(REPORT_GRACE)
        self._names = PeopleNames()
        self._early: dict[str, PerformFragment] = {}
        """Fragments that wait for a report of the world, or for a person, by request id."""
        self._patience = Silences[str](self._sight)
        """Times until which they do."""

    @property
    def deadline(self) -> Seconds | None:
        reports = (self._reports.deadline, self._seen.deadline)
        due = (self._fragments.deadline, self._arbiter.deadline, self._patience.earliest, *reports)
        return min((each for each in due if each is not None), default=None)

    def advance(self, now: Seconds) -> list[Struct]:
        """Take the step that is due by now."""
        self._now = now
        with self._containing("what is due by now"):
            self._settle(now)
        return self._take()

    def take(self, input: Input[Content], now: Seconds) -> list[Struct]:
        """Take a message, a request, or what has come of an own one."""
        self._now = now
        message = input.message
        with self._containing(f"{input.key or message.__class__.__name__} from {input.source or 'a stranger'}"):
            if isinstance(message, GenerationBegan):
                self._objects = CoveredObjects(message.covered_for)
                self._tell_condition()
            elif isinstance(message, OwnSight):
                self._look(message)
            elif isinstance(message, AnswerCame):
                self._answer(message, now)
            elif isinstance(message, Asked):
                self._serve(self._names.named(message), now)
            else:
                self._observe(message, input, now)
            self._settle(now)
        return self._take()

    def _take(self) -> list[Struct]:
        outputs = [*self._outputs]
        self._outputs.clear()
        return outputs

    @contextmanager
    def _containing(self, what: str, request: str = "") -> Iterator[None]:
        """Contain a mistake of ours in the body of `with`: it ends this request, and nothing else."""
        try:
            yield
        except Exception as error:
            self._outputs.append(TellMistake(error, what, request))

    def _publish(self, key: str, message: HeadOwner | StudyCondition | Fault | WarningFeedback) -> None:
        self._outputs.append(PublishMessage(key, message))

    # -- what is perceived ----------------------------------------------------------------------------------------

    def _observe(self, message: Told, input: Input[Content], now: Seconds) -> None:
        source, life = input.source, input.life
        if self._perception.feed(message):
            self._admit_early(now)
        self._tell(self._reports.take(message, input.key, source, life, now, past=input.past))
        seen = self._seen.take(message, source, life, now)
        if isinstance(message, SamePeople) and self._names.take(message):
            for other, name in ((each.actor, each.name) for each in message.people):
                self._arbiter.join(other, name)
            self._fragments.rename(self._names.name)
        if isinstance(message, World):
            self._perception.published(source, life)
        if seen is not None and isinstance(message, World | SamePeople):
            world = self._objects.see(seen, now)
            self._fragments.feed(world, now)
            self._arbiter.feed(world, now)
            self._admit_early(now)
        elif seen is not None:
            self._arbiter.feed((self._objects.at(now) if seen.entities else None) or seen, now)
        match message := self._names.named(message):
            case ConnectionEvent():
                self._fragments.feed(message, now)
                if not message.retold:
                    self._arbiter.feed(message, now)
            case RobotState() | Statistics() | Floor():
                self._arbiter.feed(message, now)
            case Interjection() | SyncPointProgress():
                self._fragments.feed(message, now)
            case WordSpoken(word=word, at=at):
                self._own_words.says(word, self._instant(at))
                self._fragments.feed(message, now)
            case Utterance(text=text, began=began, final=is_final):
                is_echo = began != message.at and self._own_words.are(text, self._instant(began), is_final=is_final)
                heard = replace(message, text="") if is_echo else message
                self._fragments.feed(heard, now)
                self._arbiter.feed(heard, now)
            case Unreadable(block=block, fault=fault):
                self._warn(block, "PARSING_FAILURE", fault.within(block))
            case PeerGone(participant="control"):
                self._fragments.body_lost()
                self._arbiter.body_lost()
            case PeerGone(participant="realizer"):
                self._arbiter.body_lost()
            case PeerGone(participant="recognition"):
                self._fragments.recognition_gone(now)
                self._arbiter.recognition_lost()
            case PeerAlive(participant="recognition", run=run):
                self._fragments.recognition_there(session_of(run), now)

    def _tell(self, told: Iterable[TimedReport]) -> None:
        """Take what somebody does, or did while nobody told of it."""
        for observation, _, _ in told:
            match observation:
                case ActionBegan() | ActionEnded():
                    if isinstance(observation, ActionEnded):
                        self._fragments.feed(observation, self._now)
                    elif observation.actor == self._robot and observation.action == "speak":
                        self._own_words.begins(self._instant(observation.at))
                    if observation.actor != self._robot:
                        self._arbiter.feed(observation, self._now)
                case ActorFound() | ActorLost():
                    self._arbiter.feed(observation, self._now)
                case GoesOn(began=began) if began.actor != self._robot:
                    self._arbiter.feed(began, self._now)  # its beginning is no news: it answers nothing

    def _instant(self, stamp: Stamp) -> Seconds:
        return min(self._clock.local(stamp, self._now), self._now)

    # -- what has come of own requests and questions --------------------------------------------------------------

    def _answer(self, came: AnswerCame, now: Seconds) -> None:
        shift = self._shifts.get(came.id)
        if shift is None:
            self._fragments.answer(came.id, came.answer, now)
        elif came.answer is not None and not isinstance(came.answer, Accepted):
            del self._shifts[came.id]
            if isinstance(came.answer, BlockOutcome) and came.answer.status == "done":
                self._arbiter.shift_arrived(shift, now)
            else:
                self._arbiter.shift_failed(shift, now)

    def _look(self, own: OwnSight) -> None:
        self._own_sight = own
        self._sight.woke_at, self._sight.asleep_at, self._sight.slept = own.woke_at, own.asleep_at, own.slept

    # -- requests -------------------------------------------------------------------------------------------------

    def _serve(self, request: Asked, now: Seconds) -> None:
        with self._containing(f"{kind_of(request)} {request.id}", request.id):
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
                    self._cancel(request, now)

    def _admit(self, request: PerformFragment, now: Seconds, *, may_wait: bool = True) -> None:
        """Take a fragment to be performed, or keep it while the world lacks what it needs."""
        world = self._world(now)
        if (full := self._fragments.full(len(self._early), request.fragment.id)) is not None:
            self._end(Refused(id=request.id, fault=full))  # nobody else is told: there may be thousands
            return
        try:
            if world is None or (may_wait and lacks_people(request.fragment, world)):
                self._early[request.id] = request
            else:
                self._fragments.admit(request, world, now)
        except EngageError as error:
            self._refuse(request.id, error.fault)
            id = request.fragment.id
            self._warn(id, "PARSING_FAILURE", error.fault.within(id))

    def _admit_early(self, now: Seconds) -> None:
        """Try again with the fragments that wait, now that the world is known or has changed."""
        early, self._early = self._early, {}
        for request in early.values():
            with self._containing(f"{kind_of(request)} {request.id}", request.id):
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
            self._end(Accepted(id=request.id))

    def _set_condition(self, request: SetCondition) -> None:
        self._leases.speech_only = request.speech_only
        self._end(Accepted(id=request.id))
        self._tell_condition(request.name, request.by or request.requester)
        self._end(ConditionSet(id=request.id, name=request.name, speech_only=request.speech_only))

    def _tell_condition(self, name: str = "", by: str = "") -> None:
        """Publish the condition that begins now."""
        at = Stamp(self._clock.name, self._now)
        told = StudyCondition(at=at, name=name, speech_only=self._leases.speech_only, by=by)
        self._publish(keys.STUDY_CONDITION, told)

    def _cancel(self, cancel: Cancel, now: Seconds) -> None:
        """End a lease or a fragment: its requester asked for that, is gone, or has not renewed it."""
        if self._leases.release(cancel.id):
            self._end(InhibitionEnded(id=cancel.id, reason=_how(cancel)))
        elif self._early.pop(cancel.id, None):
            self._end(Refused(id=cancel.id, fault=cancel.fault(cancel.id)))
        else:
            self._fragments.cancel(cancel.id, cancel.fault(cancel.id), now)

    def _end(self, answer: Accepted | Refused | ConditionSet | InhibitionEnded) -> None:
        self._outputs.append(AnswerRequest(answer))

    def _refuse(self, id: str, fault: Fault) -> None:
        self._end(Refused(id=id, fault=fault))
        self._publish(keys.fault(NAME), fault)

    def _warn(self, fragment: str, kind: WarningKind, message: str) -> None:
        """Publish a warning of a fragment. fragment: its id; empty if that could not be read."""
        self._publish(keys.FRAGMENT_FEEDBACK, WarningFeedback(block=fragment or None, kind=kind, message=message))

    # -- what follows ---------------------------------------------------------------------------------------------

    def _settle(self, now: Seconds) -> None:
        """Settle what has become due by now, whatever has made it so."""
        self._tell(self._reports.advance(now))
        if (seen := self._seen.advance(now)) is not None:
            self._arbiter.feed(seen, now)
        while (id := self._patience.due(now)) is not None:
            if (request := self._early.pop(id, None)) is not None:
                self._give_up(request, now)
        is_any_begun = True
        while is_any_begun:
            self._fragments.settle(now)
            self._rule(now)
            is_any_begun = self._fragments.begin(now)

    def _give_up(self, request: PerformFragment, now: Seconds) -> None:
        """Refuse a fragment that has waited long enough for the world, or for a person to speak to."""
        if self._world(now) is not None:
            self._admit(request, now, may_wait=False)
            return
        since, name, id = now - WORLD_PATIENCE, self._perception.name or "perception", request.id
        fault = self._sight.misses(name, id, since, now).following("the world is unknown", id)
        self._refuse(id, replace(fault, advice="is perception running?"))
        self._fragments.refused(request, fault, now)

    def _rule(self, now: Seconds) -> None:
        """Decide on the head."""
        self._arbiter.inhibit(self._leases.inhibition)
        self._arbiter.has_turn(self._fragments.holds_the_turn)
        ruling = self._arbiter.rule(now)
        for followed in (self._arbiter.policies, self._fragments.policies):
            while followed.mistakes:
                name, error = followed.mistakes.pop(0)
                self._outputs.append(TellMistake(error, f"policy {name!r}, which is followed no longer"))
        if ruling.changed:
            since = Stamp(self._clock.name, ruling.since)
            self._publish(keys.HEAD_OWNER, HeadOwner(owner=ruling.owner, since=since, waiting=ruling.waiting))
        if ruling.shift is not None:
            why = Fault(reason="the head is to go elsewhere", cause="cancelled", whose=NAME, service=NAME)
            # A shift waits for the one before it: the eyes would come to where they are not to be, and leave at once.
            self._outputs += [CancelRequest(id, why) for id in self._shifts]
            self._shifts[self._send(ruling.shift)] = ruling.shift.id
        if ruling.sign is not None:
            self._send(ruling.sign)

    def _send(self, order: Shift | SignOrder) -> str:
        """Send an order of the arbiter to the realizer. Returns the id of the request."""
        id = f"{self._session}/{order.id}"
        self._outputs.append(SendRequest(keys.BLOCK, PerformBlock(id=id, block=order.block)))
        return id


def _how(cancel: Cancel) -> Literal["lapsed", "released", "owner_lost"]:
    """Tell how an inhibition ends that is cancelled so."""
    if cancel.cause == "unrenewed":
        return "lapsed"
    return "owner_lost" if cancel.cause in ORPHANING - {"closed"} else "released"
