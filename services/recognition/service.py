"""The recognition service: feeds the recognizer from the bus and publishes what comes out. It decides nothing."""

from collections.abc import Iterable
from math import inf, isnan

from engage_hri.schemas import keys
from engage_hri.schemas.actions import ActionBegan, ActionEnded, ActorFound, ActorLost, OngoingActions
from engage_hri.schemas.attention import HeadOwner
from engage_hri.schemas.faults import Fault
from engage_hri.schemas.perception import HeadPose, Utterance, VoiceActivity
from engage_hri.schemas.presence import PeerAlive, PeerGone
from engage_hri.schemas.recognition import (
    ConnectionEvent,
    EventOutcome,
    RequestEvent,
    SignalTurn,
    TurnOutcome,
    session_of,
)
from engage_hri.schemas.requests import Accepted, Cancel, Refused
from engage_hri.schemas.units import Seconds, Stamp
from engage_hri.schemas.world import World
from engage_hri.services.bus.interface import Bus, Received
from engage_hri.services.recognition.config import RecognitionConfig
from engage_hri.services.recognition.events.history import Latest
from engage_hri.services.recognition.events.machine import Forgotten, Mishap
from engage_hri.services.recognition.events.open_events import OpenEventTracker
from engage_hri.services.recognition.events.scene import GoesOn, Worded
from engage_hri.services.recognition.perceive.clock_errors import ClockErrors
from engage_hri.services.recognition.perceive.reporters import OLDEST, Reporters
from engage_hri.services.recognition.perceive.reports import Told
from engage_hri.services.recognition.perceive.words import HeardWords
from engage_hri.services.recognition.recognizer import Perceived, Recognizer, Result
from engage_hri.services.recognition.statistics.published import PublishedStatistics
from engage_hri.services.requests.ends import RequestDesk
from engage_hri.services.runtime.ongoing_actions import MOST, ActionEvent
from engage_hri.services.runtime.service import Ready

STRANGERS_KEPT = 256
"""Number of programs of others whose name as a reporter is remembered."""
COMPLAINTS = 100
"""Number of bad ids that are reported as faults."""


async def recognize(bus: Bus, ready: Ready, config: RecognitionConfig) -> None:
    """Serve until cancelled. One inbox, so that actions, requests and feedback keep their order."""
    recognition = _Recognition(bus, config)
    patterns = (
        keys.ROBOT_ACTION, keys.PERCEIVED_ACTION, keys.UTTERANCE, keys.ROBOT_ONGOING, keys.ANY_PERCEIVED_ONGOING,
        keys.FEEDBACK, keys.HEAD_OWNER, keys.WORLD,
        keys.ANY_HEAD_POSE, keys.ANY_VOICE_ACTIVITY, keys.ROBOT_STATE,
        *RequestDesk.patterns("recognition"),
    )  # fmt: skip
    with bus.subscribe(*patterns) as inbox:
        ready()
        recognition.begin()
        try:
            while not inbox.is_over:
                received = await inbox.next(recognition.deadline)
                with bus.containing(received or "what is due by now"):
                    if received is None:
                        recognition.advance()
                    else:
                        recognition.take(received)
        finally:
            recognition.desk.close()


class _Recognition:
    """The parts of the service: request desk, recognizer, open events, statistics."""

    def __init__(self, bus: Bus, config: RecognitionConfig) -> None:
        self.desk = RequestDesk(bus, "recognition", self._cancel)
        self._bus = bus
        self._bad_ids: set[str] = set()
        self._reporters = Reporters(bus.robot, config.report_grace, bus.clock, self._instant)
        self._strangers: Latest[str, str] = Latest(STRANGERS_KEPT)
        """Names of reporters whose messages name no participant, by their life."""
        self._clock_errors = ClockErrors(bus.robot)
        session = session_of(bus.run)
        self._recognizer = Recognizer(bus.robot, config, clock=bus.clock, name=f"{session}-", strict=False)
        self._open_events = OpenEventTracker(bus.robot, session)
        self._statistics = PublishedStatistics(bus.robot, config, bus.clock)

    @property
    def deadline(self) -> Seconds | None:
        times = (self._recognizer.deadline, self._statistics.deadline, self._reporters.deadline)
        return min((at for at in times if at is not None), default=None)

    def begin(self) -> None:
        """Publish the statistics of all, so that those who ask before the first event get an answer."""
        self._bus.publish(keys.statistics("all"), self._statistics.overall(self._bus.now()))

    def advance(self) -> None:
        self._tell(self._reporters.advance(self._bus.now()))
        self._publish(self._recognizer.advance(self._bus.now()))

    def take(self, received: Received) -> None:
        request = self.desk.take(received)
        observation = request or received.message
        is_unaccepted = request is None and isinstance(observation, RequestEvent | SignalTurn | Cancel)
        if is_unaccepted or not self._is_credible(received):
            return
        now = self._bus.now()
        self._tell(self._reporters.advance(now))
        if isinstance(observation, OngoingActions | ActionEvent):
            name, life = self._reporter(received)
            self._tell(self._reporters.hear(observation, name, life, now, past=received.past))
        elif isinstance(observation, PeerAlive | PeerGone):
            self._tell(self._reporters.feed(observation, now))
        elif isinstance(observation, Utterance):
            self._hear(observation)
        elif isinstance(observation, Perceived):
            fault = self._feed(observation, self._when(observation, received.at))
            if fault is not None and request is not None and self.desk.is_live(request.id):
                self.desk.refuse(request.id, fault)

    def _hear(self, said: Utterance) -> None:
        began, at = self._instant(said.began), self._instant(said.at)
        ended = at if said.ended is None else self._instant(said.ended)
        self._note_error(said.actor, said.began, began)
        words = HeardWords(
            actor=said.actor, id=said.id, text=said.text, began=began, ended=ended, final=said.final,
            confidence=said.confidence,
        )  # fmt: skip
        self._feed(words, at)

    def _reporter(self, received: Received) -> tuple[str, str]:
        """Name and life of who tells of actions. The robot's are told by its body, whoever speaks for it."""
        is_perceived = received.key == keys.PERCEIVED_ACTION
        name = received.source if is_perceived else keys.reporter_of(received.key) or "control"
        if received.source:
            return name, received.life if name == received.source else ""
        if is_perceived:
            return self._strangers.get(received.life, ""), ""
        if received.life and name != "control":
            self._strangers[received.life] = name
        return name, ""

    def _tell(self, told: Iterable[Told]) -> None:
        """Feed what reporters say, or what follows from it."""
        for observation, at, is_sure in told:
            if not isinstance(observation, GoesOn):
                self._note_error(observation.actor, observation.at, at, is_sure=is_sure)
            self._feed(observation, at)

    def _cancel(self, cancel: Cancel) -> None:
        self._feed(cancel, self._bus.now())

    def _feed(self, observation: Perceived, at: Seconds) -> Fault | None:
        return self._publish(self._recognizer.feed(observation, at, self._bus.now()))

    def _is_credible(self, received: Received) -> bool:
        """True if the message came from its proper sender: the robot's body for the robot, perception for people."""
        match received.message:
            case ActionBegan(actor=actor) | ActionEnded(actor=actor):
                by_robot = actor == self._bus.robot
                return self._has_valid_id(actor) and by_robot == (received.key == keys.ROBOT_ACTION)
            case ActorFound(actor=actor) | ActorLost(actor=actor) | Utterance(actor=actor):
                return self._has_valid_id(actor) and actor != self._bus.robot
            case HeadPose(actor=actor):
                return actor != self._bus.robot and received.key == keys.head_pose(actor)
            case VoiceActivity(actor=actor):
                return actor != self._bus.robot and received.key == keys.voice_activity(actor)
            case OngoingActions(actor=actor):
                return all(action.actor == actor for action in received.message.actions) and self._may_tell(received)
            case World(people=people):
                return all(self._has_valid_id(person.id) for person in people)
        return True

    def _may_tell(self, received: Received) -> bool:
        """True if a state of ongoing actions is not too long, and on the key of its actor and its reporter."""
        assert isinstance(received.message, OngoingActions)
        if len(received.message.actions) > MOST:
            return False
        actor, reporter = received.message.actor, keys.reporter_of(received.key)
        if not reporter:
            return actor == self._bus.robot
        is_own = received.source in ("", reporter)
        return is_own and actor != self._bus.robot and received.key == keys.perceived_ongoing(reporter, actor)

    def _has_valid_id(self, actor: str) -> bool:
        """True if the id can be in a key; without that there are no events. A bad id is reported once."""
        if keys.is_chunk(actor):
            return True
        if actor not in self._bad_ids and len(self._bad_ids) < COMPLAINTS:
            self._bad_ids.add(actor)
            fault = Fault(reason=f"{actor!r} can't be in a key", advice=keys.CHUNK, service="recognition")
            self._bus.publish(keys.fault("recognition"), fault)
        return False

    def _when(self, observation: Perceived, arrived: Seconds) -> Seconds:
        """Local time of what happened, at most now and at least `OLDEST` ago, whatever the stamp says."""
        stamp: Stamp | None
        match observation:
            case HeadOwner(since=stamp) | World(at=stamp):
                pass
            case Cancel() | GoesOn() | Worded() | HeardWords():
                stamp = None
            case _:
                stamp = observation.at
        if stamp is None:
            return arrived
        at = self._instant(stamp)
        if not isinstance(observation, HeadOwner | World):
            actor = observation.actor if isinstance(observation, HeadPose | VoiceActivity) else self._bus.robot
            self._note_error(actor, stamp, at)
        return at

    def _instant(self, stamp: Stamp) -> Seconds:
        """Local time of a stamp, at most now and at least `OLDEST` ago."""
        now, told = self._bus.now(), self._bus.local(stamp)
        return now if isnan(told) else max(min(told, now), now - OLDEST)

    def _note_error(self, actor: str, stamp: Stamp, at: Seconds, *, is_sure: bool = True) -> None:
        """Note how wrong an instant may be. actor: of whom it tells. at: local time that it is taken for."""
        is_sure = is_sure and at <= self._bus.local(stamp)
        self._clock_errors.heard(actor, at, self._bus.error(stamp.clock) if is_sure else inf)

    def _publish(self, results: Iterable[Result]) -> Fault | None:
        """Publish the results. Returns the fault if a bug has shown."""
        changes: list[ConnectionEvent | Forgotten] = []
        fault: Fault | None = None
        for result in results:
            match result:
                case ConnectionEvent():
                    result = self._clock_errors.marked(result)
                    changes.append(result)
                    self._bus.publish(keys.connection_event(result.person(self._bus.robot), result.kind), result)
                case ActionBegan() | ActionEnded() | ActorFound() | ActorLost():
                    self._bus.publish(keys.RECOGNIZED_ACTION, result)
                case Accepted(id=id):
                    self.desk.accept(id)
                case Refused(id=id, fault=fault):
                    self.desk.refuse(id, fault)
                case EventOutcome():
                    self.desk.end(self._clock_errors.marked_as(result, changes))
                case TurnOutcome():
                    self.desk.end(result)
                case Forgotten(actor=actor):
                    changes.append(result)
                    self._reporters.forget(actor)
                case Mishap(actor=actor, error=error):
                    fault = self._bus.failed(error, f"what {actor or 'somebody'} does")
        events = [change for change in changes if isinstance(change, ConnectionEvent)]
        for message in self._open_events.feed(events, self._bus.stamp()):
            self._bus.publish(keys.open_events(message.actor), message)
        counted = [change for change in changes if isinstance(change, Forgotten) or not change.retold]
        for statistics in self._statistics.feed(counted, self._recognizer.session.busy, self._bus.now()):
            if statistics.actor != "all":  # a person with this id would be taken for everybody
                self._bus.publish(keys.statistics(statistics.actor or "all"), statistics)
        gone = [change.actor for change in changes if isinstance(change, Forgotten)]
        self._bus.withdraw(*(keys.open_events(actor) for actor in gone))
        self._bus.withdraw(*(keys.statistics(actor) for actor in gone if actor != "all"))
        return fault
