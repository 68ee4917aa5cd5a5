"""The recognition service: decodes, feeds the session, publishes what comes out. It decides nothing."""

from collections.abc import Iterable

from schemas import keys
from schemas.actions import ActionBegan, ActionEnded, ActorFound, ActorLost
from schemas.attention import HeadOwner
from schemas.recognition import ConnectionEvent, EventOutcome, RequestEvent, SignalTurn, TurnOutcome, session_of
from schemas.requests import Accepted, Cancel, Refused
from schemas.units import Seconds, Stamp
from schemas.world import World
from services.bus import Bus, Received
from services.recognition.config import RecognitionConfig
from services.recognition.machine import Effect
from services.recognition.open_events import OpenBook
from services.recognition.session import Observation, Session
from services.recognition.standings import Standings
from services.requests import RequestDesk
from services.runtime import Ready


async def recognize(bus: Bus, ready: Ready, config: RecognitionConfig) -> None:
    """Serve until cancelled. One inbox, so that actions, requests and feedback keep their order."""
    recognition = _Recognition(bus, config)
    patterns = (
        keys.ROBOT_ACTION, keys.PERCEIVED_ACTION, keys.FEEDBACK, keys.HEAD_OWNER, keys.WORLD,
        *RequestDesk.patterns("recognition"),
    )  # fmt: skip
    with bus.subscribe(*patterns) as inbox:
        ready()
        try:
            while True:
                received = await inbox.next(recognition.deadline)
                if received is None:
                    recognition.advance()
                else:
                    recognition.take(received)
        finally:
            recognition.desk.close()


class _Recognition:
    def __init__(self, bus: Bus, config: RecognitionConfig) -> None:
        self.desk = RequestDesk(bus, "recognition", self._cancel)
        self._bus = bus
        session = session_of(bus.run)
        self._session = Session(bus.robot, config, clock=bus.clock, name=f"{session}-")
        self._open = OpenBook(bus.robot, session)
        self._standings = Standings(bus.robot, config, bus.clock)

    @property
    def deadline(self) -> Seconds | None:
        times = (self._session.deadline, self._standings.deadline)
        return min((at for at in times if at is not None), default=None)

    def advance(self) -> None:
        self._tell(self._session.advance(self._bus.now()))

    def take(self, received: Received) -> None:
        request = self.desk.take(received)
        observation = request or received.message
        if isinstance(observation, RequestEvent | SignalTurn | Cancel) and request is None:
            return
        if isinstance(observation, Observation) and self._is_credible(received):
            self._tell(self._session.feed(observation, self._when(observation, received.at)))

    def _cancel(self, cancel: Cancel) -> None:
        self._tell(self._session.feed(cancel, self._bus.now()))

    def _is_credible(self, received: Received) -> bool:
        """Only the robot's body says what the robot does, and only perception what others do."""
        match received.message:
            case ActionBegan(actor=actor) | ActionEnded(actor=actor):
                by_robot = actor == self._bus.robot
                return _is_name(actor) and by_robot == (received.key == keys.ROBOT_ACTION)
            case ActorFound(actor=actor) | ActorLost(actor=actor):
                return _is_name(actor) and actor != self._bus.robot
            case World(entities=entities):
                return all(_is_name(entity.id) for entity in entities)
        return True

    def _when(self, observation: Observation, arrived: Seconds) -> Seconds:
        """Local time of what happened. A stamp from the future is not believed."""
        stamp: Stamp | None
        match observation:
            case HeadOwner(since=stamp) | World(at=stamp):
                pass
            case Cancel():
                stamp = None
            case _:
                stamp = observation.at
        return arrived if stamp is None else min(self._bus.local(stamp), self._bus.now())

    def _tell(self, effects: Iterable[Effect]) -> None:
        events = []
        for effect in effects:
            match effect:
                case ConnectionEvent():
                    events.append(effect)
                    self._bus.publish(keys.connection_event(effect.person(self._bus.robot), effect.kind), effect)
                case Accepted(id=id):
                    self.desk.accept(id)
                case Refused(id=id, fault=fault):
                    self.desk.refuse(id, fault)
                case EventOutcome() | TurnOutcome():
                    self.desk.end(effect)
        for book in self._open.feed(events, self._bus.stamp()):
            self._bus.publish(keys.open_events(book.actor), book)
        busy = {person.id for person in self._session.persons.values() if person.acts_since is not None}
        for statistics in self._standings.feed(events, busy, self._bus.now()):
            if statistics.actor != "all":  # a person of that name would pass for everybody
                self._bus.publish(keys.statistics(statistics.actor or "all"), statistics)


def _is_name(actor: str) -> bool:
    """Fit to be a chunk of a key expression."""
    return bool(actor) and not any(letter in "/*$?#" for letter in actor)
