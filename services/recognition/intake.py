"""Recognition between bus and recognizer, pure: messages as they come in, what is to be published out.

    intake = Intake("robot", config, clock, session="7a4d6501")
    outputs = intake.take(input, now)           # a message, of which `reads` is true
    outputs = intake.advance(now)               # whenever `deadline` has been reached

Given the same inputs in the same order, at the same instants and by the same clocks, the outputs are the same. So
nothing in here reads a clock (services/runtime/intake.py says why).
"""

from collections.abc import Iterable
from math import inf, isnan
from typing import Literal, TypeGuard, get_args

from msgspec.structs import replace

from engage_hri.schemas import keys
from engage_hri.schemas.blocks import BlockProgress, SyncPointProgress
from engage_hri.schemas.body import RobotState, WordSpoken
from engage_hri.schemas.faults import Fault
from engage_hri.schemas.fragments import HeadOwner
from engage_hri.schemas.participants import PeerAlive, PeerGone
from engage_hri.schemas.perception import (
    ANOTHER_ID,
    ActionBegan,
    ActionEnded,
    ActorFound,
    ActorLost,
    HeadPose,
    Looked,
    OngoingActions,
    Utterance,
    VoiceActivity,
)
from engage_hri.schemas.recognition import (
    ENDINGS,
    ConnectionEvent,
    EventOutcome,
    Floor,
    FloorSpeech,
    Interjection,
    OpenEvents,
    RequestEvent,
    SamePeople,
    SignalTurn,
    Statistics,
    TurnOutcome,
)
from engage_hri.schemas.requests import Accepted, Cancel, Refused
from engage_hri.schemas.units import Seconds, Stamp
from engage_hri.schemas.world import World
from engage_hri.services.bus.deadlines import FORGOTTEN_AFTER
from engage_hri.services.recognition.config import RecognitionConfig
from engage_hri.services.recognition.events.history import Latest
from engage_hri.services.recognition.events.machine import Mishap, PersonForgotten
from engage_hri.services.recognition.events.open_events import OpenEventTracker
from engage_hri.services.recognition.events.scene import Called, Worded
from engage_hri.services.recognition.perceive.clocks import ClockErrors, ClockRestarts
from engage_hri.services.recognition.perceive.identities import Identities, Join, Parting
from engage_hri.services.recognition.perceive.words import TimedWords
from engage_hri.services.recognition.recognizer import Perceived, Recognizer, Result
from engage_hri.services.recognition.statistics.published import PublishedStatistics
from engage_hri.services.reports.action_reports import OLDEST, REPORT_GRACE, ActionReports, Read
from engage_hri.services.reports.ongoing_actions import GoesOn, TimedReport
from engage_hri.services.reports.same_people import AnyStruct, renamed
from engage_hri.services.runtime.intake import (
    AnswerRequest,
    Input,
    MachineClocks,
    PublishMessage,
    TellMistake,
    WithdrawStates,
)

Former = ConnectionEvent | Statistics | SamePeople | Interjection | OpenEvents
"""Messages of a former life of recognition, which come by no bus, in the order in which they are recalled."""
Content = (
    ActionBegan | ActionEnded | ActorFound | ActorLost | OngoingActions | World | RobotState | HeadOwner | WordSpoken
    | SyncPointProgress | BlockProgress | HeadPose | Looked | VoiceActivity | Utterance | RequestEvent | SignalTurn
    | Cancel | PeerAlive | PeerGone | Former
)  # fmt: skip
"""Messages that recognition takes into account."""
_CONTENT = get_args(Content)
_News = ActionBegan | ActionEnded | ActorFound | ActorLost | HeadPose | Looked | VoiceActivity | Utterance
"""Messages that tell of what has just happened."""

EVENTS_KEPT = 64
"""Number of events that are told again if the person turns out to be another."""
COMPLAINTS = 100
"""Number of bad ids that are reported as faults."""


Output = PublishMessage | WithdrawStates | AnswerRequest | TellMistake


def _own_answer(event: ConnectionEvent) -> ConnectionEvent:
    """Take an answer in a person's place for their own, if it turns out to be that."""
    is_own = event.state == "preempted" and event.answered_by == event.responder != ""
    return replace(event, state="completed", answered_by="") if is_own else event


def reads(message: object) -> TypeGuard[Content]:
    """True for a message that recognition takes into account."""
    return isinstance(message, _CONTENT)


class Intake:
    """All of recognition but its requests' lives. session: first part of the ids of its events."""

    def __init__(self, robot: str, config: RecognitionConfig, clock: MachineClocks, session: str) -> None:
        self._robot = robot
        self._clock = clock
        self._now: Seconds = -inf
        self._bad_ids: set[str] = set()
        self._reports = ActionReports(robot, REPORT_GRACE, clock.name, self._instant)
        self._clock_errors = ClockErrors(robot)
        self._restarts = ClockRestarts()
        self._identities = Identities(robot)
        self._told: Latest[str, ConnectionEvent] = Latest(EVENTS_KEPT)
        """The latest events, each as it was last told, by id. Of people who are joined they are told again."""
        self._source = ""
        """Who has sent the message that is being taken."""
        self._recognizer = Recognizer(robot, config, clock=clock.name, name=f"{session}-", strict=False)
        self._open_events = OpenEventTracker(robot, session)
        self._statistics = PublishedStatistics(robot, config, clock.name)
        self._floor = Floor(at=Stamp(clock.name, 0.0))
        self._floor_changes = 0
        """`scene.floor_changes` when the floor was last looked at."""
        self._outputs: list[Output] = []

    @property
    def deadline(self) -> Seconds | None:
        times = (self._recognizer.deadline, self._statistics.deadline, self._reports.deadline)
        return min((at for at in times if at is not None), default=None)

    def begin(self, now: Seconds) -> list[Output]:
        """Statistics of all, so that those who ask before the first event get an answer, and who is the same."""
        self._now = now
        self._outputs.append(PublishMessage(keys.statistics("all"), self._statistics.overall(now)))
        self._tell_same()
        return self._take()

    def advance(self, now: Seconds) -> list[Output]:
        """Take all steps that are due by now."""
        self._now = now
        self._tell(self._reports.advance(now))
        self._note(self._recognizer.advance(now))
        return self._take()

    def take(self, input: Input[Content], now: Seconds) -> list[Output]:
        """Take a message."""
        self._now, self._source = now, input.source
        message = input.message
        if isinstance(message, Cancel):
            self._feed(message, now)
        elif isinstance(message, Former):
            if not input.key:
                self._resume(message, now)
        elif self._is_credible(input):
            if isinstance(message, _News) and not input.past:
                told = self._clock.local(message.at, now)
                self._restarts.hear(input.source, message.at, now if isnan(told) else told, now)
            message, key = self._identify(message, input.at), input.key
            if isinstance(message, OngoingActions) and message is not input.message:
                key = keys.perceived_ongoing(keys.reporter_of(key), message.actor)
            self._tell(self._reports.take(message, key, input.source, input.life, now, past=input.past))
            if isinstance(message, Utterance):
                self._hear(message)
            elif not isinstance(message, Read):
                self._feed(message, self._when(message, input.at))
        return self._take()

    def _resume(self, state: Former, now: Seconds) -> None:
        """Go on from a state of a former life that was told on this clock, not long ago."""
        if state.at.clock != self._clock.name or state.at.seconds > now:
            return
        if isinstance(state, SamePeople):  # the last change of it may be long ago: that life went on
            if max(self._recognizer.former_until, state.at.seconds) > now - FORGOTTEN_AFTER:
                self._identities.resume(state.people)
                for same in state.people:
                    self._recognizer.session.scene.call(self._identities.inside(same.actor), same.actor, same.name)
            self._note(())  # all has been counted by now
            return
        if state.at.seconds <= now - FORGOTTEN_AFTER:
            return
        if isinstance(state, ConnectionEvent):
            self._statistics.remember(state)
            return
        if isinstance(state, Interjection):
            self._recognizer.session.remember(self._identities.inward(state))
            return
        self._recognizer.former_until = max(self._recognizer.former_until, state.at.seconds)
        if isinstance(state, Statistics):
            self._statistics.resume(state, now)
            if state.head is not None:
                self._recognizer.resume_head(self._identities.inside(state.actor), state.head, now)
            return
        pairs = [each for each in state.events if each.kind == "adjacency_pair" and each.state == "started"]
        for former in pairs[-1:]:  # one before it has been answered, by the robot's own first turn
            effects = self._recognizer.session.resume(former, now)
            for effect in effects:
                if isinstance(effect, ConnectionEvent):
                    self._statistics.resume_event(effect)
            self._note(effects)

    def _identify(self, message: AnyStruct, at: Seconds) -> AnyStruct:
        """Find out who those are of whom a message tells. Returns it with the ids by which they are known.

        at: time at which the message came.
        """
        if isinstance(message, ActorFound | ActorLost | HeadPose | World):
            for change in self._identities.take(message, self._when(message, at)):
                if isinstance(change, Join):
                    self._join(change)
                else:
                    self._part(change)
                self._tell_same()
        return self._identities.inward(message)

    def _join(self, join: Join) -> None:
        """Take two people for one.

        One of the two goes on, and what is open with the other is lost: the former goes on as long as that is here,
        unless something is open with the newer alone.
        """
        session, newer, former, now = self._recognizer.session, join.newer, join.former, self._now
        before = session.persons.get(former)
        is_here = before is not None and before.presence.here
        is_best = session.has_open_event(former) or not session.has_open_event(newer)
        goes_on = newer not in session.persons or (is_here and is_best)
        kept, other = (former, newer) if goes_on else (newer, former)
        self._identities.join(kept, other)
        self._tell_again(join.before, join.name)
        if kept != other:
            going = self._reports.join(other, kept)
            speaks = any(each.began.action == "speak" for each in going)
            self._note(self._recognizer.join(other, kept, now, speaks=speaks))
            for each in going:
                self._feed(each, now)
        self._feed(Called(actor=kept, names=(other, join.before, join.name)), now)

    def _part(self, parting: Parting) -> None:
        """Take a person for another than was guessed. What is open with them is told as theirs from now on."""
        at, actor = Stamp(self._clock.name, self._now), parting.id
        self._tell(self._reports.part(parting.leaving, parting.old, parting.new, self._now))
        self._feed(Called(actor=parting.new, names=(*parting.leaving, parting.new)), self._now)
        if actor == parting.new:
            return  # recognition knows whose id it was by that person's own
        for id, before in tuple(self._told.items()):
            if before.person(self._robot) == parting.name and before.state not in ENDINGS:
                told = renamed(before, lambda each: actor if each == parting.name else each)
                event = self._told[id] = replace(told, at=at, retold=True)
                self._outputs.append(PublishMessage(keys.connection_event(actor, event.kind), event))
        for message in self._open_events.join(parting.name, actor, at):
            self._outputs.append(PublishMessage(keys.open_events(message.actor), message))

    def _tell_same(self) -> None:
        """Tell which ids are one person."""
        same = SamePeople(at=Stamp(self._clock.name, self._now), people=self._identities.others())
        self._outputs.append(PublishMessage(keys.SAME_PEOPLE, same))

    def _tell_again(self, other: str, name: str) -> None:
        """Tell what was told of a person by another name by this one, as far as it is remembered."""
        at, out = Stamp(self._clock.name, self._now), self._outputs
        for id, before in tuple(self._told.items()):
            event = _own_answer(self._identities.outward(self._identities.inward(before)))
            if event is not before and event != before:
                event = self._told[id] = replace(event, at=at, retold=True)
                out.append(PublishMessage(keys.connection_event(event.person(self._robot), event.kind), event))
        for message in self._open_events.join(other, name, at):
            out.append(PublishMessage(keys.open_events(message.actor), message))
        self._statistics.join(other, name, self._now)
        states = (keys.open_events(other), *([keys.statistics(other)] if other != "all" else []))
        out.append(WithdrawStates(states))
        self._note(())

    def _take(self) -> list[Output]:
        outputs, self._outputs = self._outputs, []
        return outputs

    def _hear(self, said: Utterance) -> None:
        began, at = self._instant(said.began), self._instant(said.at)
        ended = at if said.ended is None else self._instant(said.ended)
        self._note_error(said.actor, said.began, began)
        words = TimedWords(
            actor=said.actor, id=said.id, text=said.text, began=began, ended=ended, final=said.final,
            confidence=said.confidence, to=frozenset(said.to) or None,
        )  # fmt: skip
        self._feed(words, at)

    def _tell(self, told: Iterable[TimedReport]) -> None:
        """Feed what reporters say, or what follows from it."""
        for observation, at, is_sure in told:
            if not isinstance(observation, GoesOn):
                self._note_error(observation.actor, observation.at, at, is_sure=is_sure)
            self._feed(observation, at)

    def _feed(self, observation: Perceived, at: Seconds) -> None:
        request = observation.id if isinstance(observation, RequestEvent | SignalTurn) else ""
        self._note(self._recognizer.feed(observation, at, self._now), request)

    def _is_credible(self, input: Input[Content]) -> bool:
        """True if the message came from its proper sender: the robot's body for the robot, perception for people."""
        match input.message:
            case ActorFound(same_as=former) if former and not self._can_be_person(former):
                return False
            case ActionBegan() | ActionEnded() | ActorFound() | ActorLost() as event:
                return self._has_valid_id(event.actor)
            case Utterance(actor=actor):
                return self._has_valid_id(actor) and actor != self._robot
            case HeadPose(actor=actor):
                return actor != self._robot and input.key == keys.head_pose(actor)
            case VoiceActivity(actor=actor):
                return actor != self._robot and input.key == keys.voice_activity(actor)
            case World(people=people):
                return all(self._has_valid_id(person.id) for person in people)
        return True

    def _has_valid_id(self, actor: str) -> bool:
        """True if the id can be in a key; without that there are no events. A bad id is reported once."""
        return keys.is_chunk(actor) or self._complain(actor, f"{actor!r} can't be in a key", keys.CHUNK)

    def _can_be_person(self, actor: str) -> bool:
        """True if somebody can be the same person as this. What cannot be one is reported once."""
        if actor == self._robot or actor in self._identities.things:
            kind = "the robot" if actor == self._robot else "a thing of the world"
            return self._complain(actor, f"nobody can be the same person as {actor!r}: it is {kind}", ANOTHER_ID)
        return self._has_valid_id(actor)

    def _complain(self, id: str, reason: str, advice: str) -> Literal[False]:
        if id not in self._bad_ids and len(self._bad_ids) < COMPLAINTS:
            self._bad_ids.add(id)
            fault = Fault(reason=reason, advice=advice, service="recognition")
            self._outputs.append(PublishMessage(keys.fault("recognition"), fault))
        return False

    def _when(self, observation: Perceived, arrived: Seconds) -> Seconds:
        """Local time of what happened, at most now and at least `OLDEST` ago, whatever the stamp says."""
        stamp: Stamp | None
        match observation:
            case HeadOwner(since=stamp) | World(at=stamp):
                pass
            case Cancel() | GoesOn() | Worded() | Called() | TimedWords():
                stamp = None
            case _:
                stamp = observation.at
        if stamp is None:
            return arrived
        at = self._instant(stamp)
        if not isinstance(observation, HeadOwner | Looked | World):
            actor = observation.actor if isinstance(observation, HeadPose | VoiceActivity) else self._robot
            self._note_error(actor, stamp, at)
        return at

    def _instant(self, stamp: Stamp) -> Seconds:
        """Local time of a stamp, at most now and at least `OLDEST` ago."""
        now, told = self._now, self._clock.local(stamp, self._now)
        told += self._restarts.ahead(self._source, stamp.clock)
        return now if isnan(told) else max(min(told, now), now - OLDEST)

    def _note_error(self, actor: str, stamp: Stamp, at: Seconds, *, is_sure: bool = True) -> None:
        """Note how wrong an instant may be. actor: of whom it tells. at: local time that it is taken for."""
        is_sure = is_sure and at <= self._clock.local(stamp, self._now)
        self._clock_errors.heard(actor, at, self._clock.error(stamp.clock) if is_sure else inf)

    def _tell_floor(self) -> None:
        """Tell who speaks, and to whom, if that has changed."""
        session, name = self._recognizer.session, self._clock.name
        if session.scene.floor_changes == self._floor_changes:
            return
        self._floor_changes = session.scene.floor_changes
        told, ended = (
            tuple(
                self._identities.outward(
                    FloorSpeech(
                        actor=each.actor, since=Stamp(name, each.since), to=tuple(sorted(each.named)),
                        until=None if each.until is None else Stamp(name, each.until),
                    )
                )
                for each in speeches
            )
            for speeches in (session.floor(), session.scene.ended())
        )  # fmt: skip
        floor = Floor(at=Stamp(name, self._now), speeches=told, ended=ended)
        if (told, ended) != (self._floor.speeches, self._floor.ended):
            self._floor = floor
            self._outputs.append(PublishMessage(keys.FLOOR, floor))

    def _note(self, results: Iterable[Result], request: str = "") -> None:
        """Note what is to be published. request: the one that was fed; a bug ends it."""
        changes: list[ConnectionEvent | PersonForgotten] = []
        out = self._outputs
        for result in results:
            match result:
                case ConnectionEvent():
                    self._told[result.id] = result = self._identities.outward(self._clock_errors.marked(result))
                    changes.append(result)
                    out.append(PublishMessage(keys.connection_event(result.person(self._robot), result.kind), result))
                case Interjection():
                    result = self._identities.outward(result)
                    out.append(PublishMessage(keys.interjection(result.actor), result))
                case ActionBegan() | ActionEnded() | ActorFound() | ActorLost():
                    out.append(PublishMessage(keys.RECOGNIZED_ACTION, self._identities.outward(result)))
                case Accepted() | Refused() | TurnOutcome():
                    out.append(AnswerRequest(result))
                case EventOutcome():
                    out.append(AnswerRequest(self._clock_errors.marked_as(result, changes)))
                case PersonForgotten(actor=actor):
                    self._reports.forget(actor)
                    if not self._identities.is_other(actor):
                        changes.append(PersonForgotten(self._identities.name(actor)))
                        if self._identities.forget(actor):
                            self._tell_same()
                case Mishap(actor=actor, error=error):
                    out.append(TellMistake(error, f"what {actor or 'somebody'} does", request))
        self._tell_floor()
        events = [change for change in changes if isinstance(change, ConnectionEvent)]
        for message in self._open_events.feed(events, Stamp(self._clock.name, self._now)):
            out.append(PublishMessage(keys.open_events(message.actor), message))
        counted = [change for change in changes if isinstance(change, PersonForgotten) or not change.retold]
        name = self._identities.name
        busy = {name(id) for id in self._recognizer.session.busy}
        here = {name(id): each for id, each in self._recognizer.presences().items()}
        contacts = {name(id): much for id, much in self._recognizer.contacts().items()}
        heads = {name(id): head for id, head in self._recognizer.heads().items()}
        self._statistics.feed(counted, busy, self._now, contacts, heads, here)
        for statistics in self._statistics.told(self._now):
            if statistics.actor != "all":  # a person with this id would be taken for everybody
                out.append(PublishMessage(keys.statistics(statistics.actor or "all"), statistics))
        if gone := [change.actor for change in changes if isinstance(change, PersonForgotten)]:
            out.append(WithdrawStates(tuple(keys.open_events(actor) for actor in gone)))
            out.append(WithdrawStates(tuple(keys.statistics(actor) for actor in gone if actor != "all")))
