"""The whole of recognition as one pure machine: observations in, effects out, and when it must be woken.

    session = Session(robot="robot", config=RecognitionConfig())
    effects = session.feed(observation, at)         # at: when it happened, on the session's clock
    effects = session.advance(now)                  # whenever `session.deadline` has been reached

Everything is decided by the times of the observations, not of their arrival: what was due before an observation
happens before it, at its own time. An answer at the very limit still counts.
"""

from collections.abc import Iterator

from schemas.actions import ActionBegan, ActionEnded, ActorFound, ActorLost
from schemas.attention import HeadOwner
from schemas.behaviors import Action, Event, TurnSignal
from schemas.faults import Fault
from schemas.feedback import BlockProgress, SyncPointProgress
from schemas.presence import PeerGone
from schemas.recognition import EventOutcome, RequestEvent, SignalTurn, TurnOutcome
from schemas.requests import Accepted, Cancel, Refused
from schemas.units import Seconds
from schemas.world import World
from services.recognition.config import RecognitionConfig
from services.recognition.latest import Latest
from services.recognition.limits import BLOCKS_KEPT, Blocks, LimitClock
from services.recognition.machine import Effect, Ledger, Machine, UnderWay
from services.recognition.person import Due, Person
from services.recognition.presence import NEVER
from services.recognition.scene import Covered, Scene
from services.recognition.shared_gaze import SharedGaze

Observation = (
    ActionBegan | ActionEnded | ActorFound | ActorLost | RequestEvent | SignalTurn | Cancel
    | SyncPointProgress | BlockProgress | HeadOwner | World | PeerGone
)  # fmt: skip
TURNS_KEPT = 64
"""Ended turns that are remembered, for an adjacency pair that is announced after its turn's end."""
ACTIONS_KEPT = 256


class Session:
    """All persons with one robot. clock: of the stamps in the effects. name: prefix of the events' ids.

    strict: an undefined transition, that is a bug here, raises `UndefinedTransition`.
    """

    def __init__(
        self, robot: str, config: RecognitionConfig, *, clock: str = "loop", name: str = "", strict: bool = True
    ) -> None:
        self.robot = robot
        self.persons: dict[str, Person] = {}
        self.blocks = Blocks()
        self.scene = Scene(robot, config.gaze_resolution)
        self._config = config
        self._strict = strict
        self._ledger = Ledger(clock, name)
        self._due: Due | None = None
        self._ended_turns: Latest[str, Seconds] = Latest(TURNS_KEPT)
        self._robot_does: dict[tuple[str, Action], ActionBegan] = {}
        """Its speech and gestures, by behavior."""
        self._live: dict[str, tuple[Person, Machine]] = {}
        """Undecided requests."""
        self._answering_blocks: Latest[str, Person] = Latest(BLOCKS_KEPT)
        self._performed: Latest[tuple[str, Action, str, tuple[str, ...]], tuple[Seconds, Seconds]]
        self._performed = Latest(ACTIONS_KEPT)
        """When actions last began and ended: what is older, or comes again, is no news."""

    # -- time ---------------------------------------------------------------------------------------------------

    @property
    def deadline(self) -> Seconds | None:
        """When `advance` has something to do, unless an observation comes first."""
        return None if self._due is None else self._due.at

    def advance(self, now: Seconds) -> list[Effect]:
        """What happens by itself up to and including `now`."""
        while self._due is not None and self._due.at <= now:
            self._due.happen(self._due.at)
            self._due = self._first_due()
        return self._take()

    def _advance_before(self, at: Seconds) -> None:
        while self._due is not None and self._due.at < at:
            self._due.happen(self._due.at)
            self._due = self._first_due()

    def _first_due(self) -> Due | None:
        deadline = self.scene.gaze.deadline
        first = None if deadline is None else Due(deadline, self._robot_gaze_expires)
        for person in self.persons.values():
            due = person.first_due()
            if due is not None and (first is None or due.at < first.at):
                first = due
        return first

    # -- observations -------------------------------------------------------------------------------------------

    def feed(self, observation: Observation | Covered, at: Seconds) -> list[Effect]:
        """Take what happened at `at`. Slightly late or repeated observations are put right or ignored."""
        self._advance_before(at)
        match observation:
            case ActionBegan(actor=self.robot):
                self._robot_begins(observation, at)
            case ActionEnded(actor=self.robot):
                self._robot_ends(observation, at)
            case ActionBegan():
                self._person_begins(self._person(observation.actor), observation, at)
            case ActionEnded() if observation.actor in self.persons:
                self._person_ends(self.persons[observation.actor], observation, at)
            case ActorFound(actor=actor) if actor != self.robot:
                self._person(actor).presence.found(at)
            case ActorLost(actor=actor) if actor in self.persons:
                self.persons[actor].presence.lost(at)
            case RequestEvent():
                self._request(observation, at)
            case SignalTurn():
                self._signal(observation, at)
            case Cancel(id=id):
                self._cancel(id, at)
            case SyncPointProgress(block=block):
                name = self.blocks.realised(block, observation.behavior, observation.sync, at)
                for machine in self._gaze_machines():
                    if machine.clock is not None and machine.event is not None and machine.event.block == block:
                        machine.clock.realised(name, at)
            case BlockProgress(block=str() as block, progress="end"):
                self._block_ended(block, at, aborted=observation.status in ("failed", "interrupted"))
            case PeerGone(participant="control"):
                self._robot_stops(at)
                self.scene.gaze.end((), at)
            case HeadOwner(owner=owner):
                self.scene.head_owner = owner
                for person in self.persons.values():
                    person.head_owner_changed(at)
            case World():
                self.scene.see(observation)
                for person_id in sorted(self.scene.people_in_world):
                    self._person(person_id)
            case Covered():
                self.scene.covered = observation
                for person in self.persons.values():
                    person.hands_changed()
        self._due = self._first_due()
        return self._take()

    def _take(self) -> list[Effect]:
        effects = self._ledger.take()
        for effect in effects:
            if isinstance(effect, EventOutcome):
                self._live.pop(effect.id, None)
        return effects

    # -- what actors do -----------------------------------------------------------------------------------------

    def _robot_begins(self, began: ActionBegan, at: Seconds) -> None:
        if not self._is_news(began, at):
            return
        match began.action:
            case "look":
                if self.scene.gaze.begin(began.targets, at):
                    self._robot_gaze_changed(at)
            case "speak":
                self._robot_does[began.behavior, "speak"] = began
                if self.scene.robot_speaks_since is None:
                    self.scene.robot_speaks_since = at
                    self.scene.speaks(self.robot)
                    for person in self.persons.values():
                        person.robot_speaks(at)
            case "nod" | "shake" | "point":
                self._robot_does[began.behavior, began.action] = began
                for person in self.persons.values():
                    person.robot_gestures(began.action, at)

    def _robot_ends(self, ended: ActionEnded, at: Seconds) -> None:
        if not self._is_news(ended, at):
            return
        self._robot_does.pop((ended.behavior, ended.action), None)
        match ended.action:
            case "look":
                self.scene.gaze.end(ended.targets, at)
            case "speak":
                speaks = any(action == "speak" for _, action in self._robot_does)
                if self.scene.robot_speaks_since is not None and not speaks:
                    self.scene.robot_speaks_since = None
                    self.scene.falls_silent(self.robot, at)
                    for person in self.persons.values():
                        person.robot_falls_silent(at)
            case "nod" | "shake" | "point":
                for person in self.persons.values():
                    person.robot_gesture_ends(ended.action, at)

    def _robot_stops(self, at: Seconds, behaviors: str = "") -> None:
        """Whatever ends have been lost: what the robot says and does with its hands and head is over.

        behaviors: what their ids begin with.
        """
        for began in list(self._robot_does.values()):
            if began.behavior.startswith(behaviors):
                ended = ActionEnded(
                    actor=self.robot, action=began.action, at=began.at, targets=began.targets, behavior=began.behavior
                )
                self._robot_ends(ended, at)

    def _person_begins(self, person: Person, began: ActionBegan, at: Seconds) -> None:
        if not self._is_news(began, at) or not person.presence.seen(at):
            return
        confidence = began.confidence
        match began.action:
            case "look":
                person.looks(began.targets, at, confidence)
            case "point":
                person.points(began.targets, at, confidence)
            case "speak":
                person.speaks(at, confidence)
            case "nod" | "shake":
                person.gestures(began.action, at, confidence)
            case "act":
                person.manipulates(at, confidence)

    def _person_ends(self, person: Person, ended: ActionEnded, at: Seconds) -> None:
        if not self._is_news(ended, at):
            return
        match ended.action:
            case "look":
                person.looks_away(ended.targets, at)
            case "point":
                person.pair.ends("point", at, by_robot=False)
            case "speak":
                person.falls_silent(at)
            case "nod" | "shake":
                person.gesture_ends(ended.action, at)
            case "act":
                person.manipulation_ends(at)

    def _is_news(self, action: ActionBegan | ActionEnded, at: Seconds) -> bool:
        """Did it neither come twice nor too late, after something newer of the same kind?"""
        key = (action.actor, action.action, action.behavior, action.targets)
        began, ended = self._performed.get(key, (NEVER, NEVER))
        if isinstance(action, ActionBegan):
            news = at > began and at >= ended
            began = at if news else began
        else:
            news = at > ended and at >= began
            ended = at if news else ended
        self._performed[key] = (began, ended)
        return news

    def _robot_gaze_expires(self, at: Seconds) -> None:
        self._robot_gaze_changed(self.scene.gaze.expire())

    def _robot_gaze_changed(self, at: Seconds) -> None:
        for person in self.persons.values():
            person.gaze_changed(at)

    # -- requests -----------------------------------------------------------------------------------------------

    def _request(self, request: RequestEvent, at: Seconds) -> None:
        """Accept and begin, or refuse, a robot-initiated event (thesis Fig. 5.2)."""
        if request.id in self._live:
            return
        fault = self._fault_in(request)
        if fault is not None:
            self._ledger.effects.append(Refused(id=request.id, fault=fault))
            return
        self._ledger.effects.append(Accepted(id=request.id))
        wanted, person = request.event, self.persons[request.event.responder]
        event = UnderWay(
            kind=wanted.kind, initiator=self.robot, responder=person.id, started=at, objects=wanted.objects,
            cause=wanted.cause, optional=wanted.optional, block=request.block, behavior=wanted.id, turn=wanted.turn,
            request=request.id,
        )  # fmt: skip
        ended = self.blocks.ended(request.block)
        match wanted.kind:
            case "directed_gaze":
                clock = self._clock(event, wanted, self._config.directed_gaze_limit)
                machine: Machine = person.robot_directs(event, clock)
            case "mutual_facial_gaze":
                person.robot_looks_at_face(event, self._clock(event, wanted, self._config.mutual_facial_gaze_limit))
                machine = person.facial
            case "adjacency_pair":
                self._ask(person, event, wanted)
                machine = person.pair
            case "backchannel":
                self._announce_backchannel(person, event)
                machine = person.robot_backchannel
                if ended is not None:
                    person.robot_backchannel.ends(max(at, ended))
        if event.request:
            self._live[request.id] = (person, machine)

    def _fault_in(self, request: RequestEvent) -> Fault | None:
        event, where = request.event, f"{request.block}: {request.event.id}"
        person = self.persons.get(event.responder)
        if person is None:
            known = ", ".join(sorted(self.persons)) or "nobody"
            return Fault(reason=f"unknown actor {event.responder!r}", where=where, advice=f"known: {known}")
        if not person.presence.here:
            return Fault(reason=f"{event.responder!r} has gone", where=where)
        if event.kind == "directed_gaze" and not event.objects:
            return Fault(reason="directed gaze without objects", where=where)
        unknown = [name for name in event.objects if not self.scene.knows(name)]
        if unknown:
            return Fault(reason=f"unknown object {', '.join(map(repr, unknown))}", where=where)
        if event.limit is not None and not event.limit > 0:
            return Fault(reason=f"limit must be greater than 0 s, not {event.limit}", where=where)
        return None

    def _clock(self, event: UnderWay, wanted: Event, default: Seconds) -> LimitClock:
        event.limit = wanted.limit or default
        clock = LimitClock(event.started, event.limit, wanted.anchors, self._config.turn_patience)
        for name in clock.waiting:
            realised = self.blocks.point(event.block, name)
            if realised is not None:
                clock.realised(name, realised)
        ended = self.blocks.ended(event.block)
        if ended is not None:
            clock.stop_waiting(ended)
        return clock

    def _ask(self, person: Person, event: UnderWay, wanted: Event) -> None:
        event.accept = wanted.accept or self._config.accept
        by_acting = "act" in event.accept
        default = self._config.manipulation_limit if by_acting else self._config.adjacency_pair_limit
        event.limit = wanted.limit or default
        person.robot_asks(event)
        turn_end = self._ended_turns.get(event.turn) if event.turn else self.blocks.ended(event.block)
        if turn_end is not None:
            person.turn_ends(max(turn_end, event.started))

    def _announce_backchannel(self, person: Person, event: UnderWay) -> None:
        """The person holds the floor, so it is the initiator. What was noticed already gets no second event."""
        event.initiator, event.responder = person.id, self.robot
        noticed = person.robot_backchannel.last
        if noticed is not None and abs(event.started - noticed[0]) <= self._config.backchannel_limit:
            self._ledger.answer(event.request, noticed[1], event.started)
            event.request = ""
        else:
            person.robot_backchannel.announced(event)

    def _cancel(self, id: str, at: Seconds) -> None:
        person, machine = self._live.pop(id, (None, None))
        if person is None or machine is None or machine.event is None or machine.event.request != id:
            return
        if machine is person.pair:
            person.pair.abort(at)
        else:
            machine.step("withdraw", at)
            person.forget_idle(at)

    # -- turns and blocks ---------------------------------------------------------------------------------------

    def _signal(self, request: SignalTurn, at: Seconds) -> None:
        """What became of a turn. Ends at once, whatever it says."""
        signal = request.signal
        match signal.signal:
            case "ended":
                self._ended_turns[signal.turn] = at
                for person in self._addressees(signal):
                    if person.pair.is_turn(signal.turn):
                        person.turn_ends(at)
            case "answered" | "repaired":
                for person in self._addressees(signal):
                    if signal.signal == "repaired":
                        person.pair.repaired(at)
                    person.pair.robot_begins("speak", at)  # either turn answers a person who waits
                    if request.block and self.blocks.ended(request.block) is None:
                        self._answering_blocks[request.block] = person
            case "aborted":
                for person in self._addressees(signal):
                    person.abort(at, turn=signal.turn)
        self._ledger.effects.append(TurnOutcome(id=request.id, at=self._ledger.stamp(at)))

    def _addressees(self, signal: TurnSignal) -> list[Person]:
        if signal.actor:
            return [self.persons[signal.actor]] if signal.actor in self.persons else []
        return list(self.persons.values())

    def _block_ended(self, block: str, at: Seconds, *, aborted: bool) -> None:
        self.blocks.end(block, at)
        self._robot_stops(at, f"{block}:")
        for person in self.persons.values():
            person.block_ended(block, at, aborted=aborted)
        answered = self._answering_blocks.pop(block, None)
        if answered is not None:
            answered.pair.answered_block_ended(at)

    # -- persons ------------------------------------------------------------------------------------------------

    def _person(self, id: str) -> Person:
        if id not in self.persons:
            self.persons[id] = Person(id, self.scene, self._config, self._ledger, strict=self._strict)
        return self.persons[id]

    def _gaze_machines(self) -> Iterator[SharedGaze]:
        for person in self.persons.values():
            yield from person.gaze_machines()
