"""Connection events of the robot with all people, as one pure machine: observations in, effects and a deadline out.

    session = Session(robot="robot", config=RecognitionConfig())
    effects = session.feed(observation, at)         # at: time of the event itself, on the session's clock
    effects = session.advance(now)                  # whenever `session.deadline` has been reached

The times of the observations decide, not those of their arrival: a step that was due before an observation happens
before it, at its own time. An answer exactly at the limit still counts.
"""

from collections.abc import Callable, Container, Iterable, Set
from math import inf
from typing import Any, get_args

from engage_hri.schemas.behaviors import EVENT_KINDS, Action, Event, TurnSignal
from engage_hri.schemas.blocks import BlockProgress, SyncPointProgress
from engage_hri.schemas.body import RobotState
from engage_hri.schemas.faults import Fault
from engage_hri.schemas.fragments import HeadOwner
from engage_hri.schemas.perception import ActionBegan, ActionEnded, ActorFound, ActorLost
from engage_hri.schemas.recognition import ConnectionEvent, EventOutcome, RequestEvent, SignalTurn, TurnOutcome
from engage_hri.schemas.requests import ORPHANING, Accepted, Cancel, Refused
from engage_hri.schemas.units import Seconds
from engage_hri.schemas.world import World
from engage_hri.services.recognition.config import RecognitionConfig
from engage_hri.services.recognition.events.addressing import WHOEVER, WORDS_AFTER, Addressees, Spoken, renamed_in
from engage_hri.services.recognition.events.exchange import TURN_PATIENCE
from engage_hri.services.recognition.events.history import ActionHistory, Latest
from engage_hri.services.recognition.events.limits import BLOCKS_KEPT, ROUNDING, Blocks, LimitClock, anchor
from engage_hri.services.recognition.events.machine import Effect, EventWriter, Mishap, OngoingEvent
from engage_hri.services.recognition.events.people import People
from engage_hri.services.recognition.events.person import Part, PersonRecognition
from engage_hri.services.recognition.events.scene import Called, Covered, SessionScene, Worded
from engage_hri.services.recognition.events.talk import Step
from engage_hri.services.reports.ongoing_actions import GoesOn

WORDS_PATIENCE: Seconds = 10.0
"""Time after the end of an event for which it is told again, should its words become known or be corrected. Decision
0065."""
ACCEPT: tuple[Action, ...] = ("speak", "nod", "shake", "point")
"""Actions that answer an adjacency pair of the robot, unless its request names others. Thesis 2.2.3."""
PARTS: dict[Action, Part] = {"look": "looks", "point": "all", "act": "all"}
"""What of a person an action may change, of theirs or of the robot; any other only "rest". Hands go with looks: a
point directs the other's, and who moves a thing looks at it."""
SETTLING: Seconds = 0.35
"""Longest time for which events wait for raw perception that is undecided.
Decision 0009."""
Observation = (
    ActionBegan | ActionEnded | ActorFound | ActorLost | RequestEvent | SignalTurn | Cancel
    | GoesOn | Worded | Called | SyncPointProgress | BlockProgress | HeadOwner | World | RobotState
)  # fmt: skip
TURNS_KEPT = 64
"""Number of ended turns that are remembered, for a pair announced after the end of its turn; aborted ones too."""
SILENCE: Seconds = 3.0
"""Time after a body last showed that it speaks from which on its speech is over, even without a report."""
ACTIONS_KEPT = 256
"""Number of actions of the robot for which it is remembered when they last began and ended."""


class Session:
    """Recognition for one robot and all persons. clock: of the stamps in the effects. name: prefix of the event ids.

    strict: a bug here, an undefined transition for instance, raises. Otherwise it ends the open events of the person
    concerned, is reported as a `Mishap`, and everything else goes on.
    """

    def __init__(
        self, robot: str, config: RecognitionConfig, *, clock: str = "loop", name: str = "", strict: bool = True
    ) -> None:
        self.robot = robot
        self.blocks = Blocks()
        self.scene = SessionScene(robot, config.gaze_resolution)
        self._config = config
        self._writer = EventWriter(clock, name, words_patience=WORDS_PATIENCE)
        self._people = People(self.scene, config, self._writer, strict=strict)
        self._agenda = self._people.agenda
        self.persons = self._people.persons
        """Persons who are here, or have not been gone for long."""
        self.busy: Set[str] = self.scene.acting
        """Persons with a task in hand."""
        self.contacts = self._people.contacts
        self.presences = self._people.presences
        """Tells contact with each person for whom it has changed since the last call."""
        self.remember = self._writer.remember
        """Takes an interjection that a former life has told, so that it is not told again."""
        self._ended_turns: Latest[str, Seconds] = Latest(TURNS_KEPT)
        self._aborted_turns: Latest[str, Seconds] = Latest(TURNS_KEPT)
        self._robot_actions: dict[tuple[str, Action], ActionBegan] = {}
        """Present speech and gestures of the robot, by behavior."""
        self._heard_at: Seconds | None = None
        """Time when the robot's body last showed that it speaks."""
        self._live: dict[str, tuple[OngoingEvent, LimitClock | None]] = {}
        """Undecided requests, with the clocks of their limits."""
        self._answering_blocks: Latest[str, str] = Latest(BLOCKS_KEPT)
        """Blocks that answer a person, with the id of that person (empty: all)."""
        self._history = ActionHistory(ACTIONS_KEPT)
        """The robot's actions."""
        self._addressed: Latest[str, Addressees] = Latest(BLOCKS_KEPT)
        """To whom the robot speaks in each block."""
        self._takes: dict[type, Callable[[Any, Seconds], object]] = {
            ActionBegan: self._begins, ActionEnded: self._ends, GoesOn: self._goes_on,
            ActorFound: self._found, ActorLost: self._lost, World: self._people.see, Covered: self._hands_changed,
            Worded: self._understand, RequestEvent: self._request, SignalTurn: self._signal, Cancel: self._cancel,
            SyncPointProgress: self._point_realised, BlockProgress: self._block_progresses,
            RobotState: self._robot_is_heard, HeadOwner: self._head_owner_changed,
            Called: lambda called, at: self.scene.call(called.actor, *called.names),
        }  # fmt: skip
        """What each kind of observation changes."""

    @property
    def in_company(self) -> bool:
        """True if more than one person is here."""
        return len(self.scene.company("")) > 1

    def has_open_event(self, person: str) -> bool:
        """True if an event with the person is open, or asked for and not begun."""
        live = (each for each, _ in self._live.values())
        return self._writer.has_open(person) or any(person in (each.initiator, each.responder) for each in live)

    def floor(self) -> list[Spoken]:
        """All speeches that go on, the first first; their addressees may not be known yet."""
        speeches = (each.talk.speeches.going_on for each in self.persons.values() if each.presence.here)
        return sorted(filter(None, (self.scene.robot_spoken, *speeches)), key=lambda each: (each.since, each.actor))

    # -- time ---------------------------------------------------------------------------------------------------

    @property
    def deadline(self) -> Seconds | None:
        """Time at which `advance` has something to do, unless an observation comes first."""
        due = self._agenda.look
        return None if due == inf else due

    def advance(self, now: Seconds) -> list[Effect]:
        """Take all steps that are due up to and including `now`."""
        while self._agenda.look <= now:
            self._take_step()
        self._people.forget(now)
        return self._take()

    def _take_step(self) -> None:
        """Take the step that is due first: a person's, or the end of the robot's look."""
        self._writer.now = max(self._writer.now, self._agenda.look)
        if self._agenda.first != self.robot:
            self._people.advance()
        else:
            self._agenda.clear(self.robot)
            self._robot_gaze_changed(self.scene.gaze.expire())

    # -- observations -------------------------------------------------------------------------------------------

    def feed(self, observation: Observation | Covered, at: Seconds) -> list[Effect]:
        """Take an observation of what happened at `at`. Slightly late or repeated ones are put right or ignored."""
        while self._agenda.look < at - ROUNDING:
            self._take_step()
        self._people.forget(at)
        self._writer.now = at
        self._takes[type(observation)](observation, at)
        return self._take()

    def _begins(self, began: ActionBegan, at: Seconds) -> None:
        if began.actor == self.robot:
            self._robot_begins(began, at)
        else:
            may_be_known = began.action == "look" and began.actor in self.scene.unknown  # to whom the person speaks
            part = "all" if may_be_known else PARTS.get(began.action, "rest")
            self._people.observe(began.actor, at, lambda person: person.begins(began, at), part)

    def _ends(self, ended: ActionEnded, at: Seconds) -> None:
        if ended.actor == self.robot:
            self._robot_ends(ended, at)
        elif ended.actor in self.persons:
            self._people.observe(
                ended.actor, at, lambda person: person.ends(ended, at), PARTS.get(ended.action, "rest")
            )

    def _goes_on(self, observation: GoesOn, at: Seconds) -> None:
        began, since = observation.began, observation.since
        if began.actor == self.robot:
            self._robot_goes_on(began, since, at)
        else:
            self._people.observe(began.actor, at, lambda person: person.goes_on(began, since, at))

    def _found(self, found: ActorFound, at: Seconds) -> None:
        if found.actor != self.robot:
            self._people.observe(found.actor, at, lambda person: person.presence.found(at))

    def _lost(self, lost: ActorLost, at: Seconds) -> None:
        if lost.actor in self.persons:
            self._people.observe(lost.actor, at, lambda person: person.presence.lost(at))

    def _hands_changed(self, covered: Covered, at: Seconds) -> None:
        self.scene.covered = covered
        self._people.apply_to_all(at, lambda person: person.gazes.hands_changed(), "looks")

    def _head_owner_changed(self, head: HeadOwner, at: Seconds) -> None:
        self.scene.head_owner = head.owner
        self._people.apply_to_all(
            at, lambda person: person.gazes.head_owner_changed(at), "looks", _has_gaze_under_way
        )

    def resume(self, former: ConnectionEvent, at: Seconds) -> list[Effect]:
        """Go on with a pair that a former life has begun. The end of its turn is not known: it counts as over now.

        Nor is it known which actions answer the robot: all do. The pair has another id, and no delay is told of it.
        """
        person = former.person(self.robot)
        event = OngoingEvent(
            kind=former.kind, initiator=former.initiator, responder=former.responder, started=former.started.seconds,
            cause=former.cause, optional=former.optional, limit=former.limit, accept=(*ACCEPT, "act"),
            block=former.block, behavior=former.behavior, turn=former.turn, confidence=former.confidence,
            is_former=True,
        )  # fmt: skip
        by_robot = former.initiator == self.robot
        self._people.observe(
            person,
            at,
            lambda person: person.talk.take(at, lambda talk: talk.exchange.pair.resume(event, at, by_robot=by_robot)),
        )
        return self._take()

    def lose_track(self, person: str, at: Seconds) -> list[Effect]:
        """Begin anew with this person after a failure: its open events end as lost."""
        if person in self.persons:
            self._people.lose_track(self.persons[person], at)
            self._lose_untold(person, at)
        return self._take()

    def join(self, other: str, kept: str, at: Seconds, *, speaks: bool = False) -> list[Effect]:
        """Take two persons for one, who is `kept` from now on. speaks: what the other says goes on.

        What is open with the other is lost, but for what they have said and is not decided.
        """
        for block, to in tuple(self._addressed.items()):
            self._addressed[block] = renamed_in(to, other, kept)
        if self.scene.turn is not None:
            self.scene.turn = self.scene.turn[0], renamed_in(self.scene.turn[1], other, kept)
        self._people.join(other, kept, at, speaks=speaks)
        self._lose_untold(other, at)
        return self._take()

    def _lose_untold(self, person: str, at: Seconds) -> None:
        """End the events that were asked for and not begun yet: a bug has shown before, or while they waited."""
        for event, _ in list(self._live.values()):
            if not event.id and event.request and person in (event.initiator, event.responder):
                self._writer.publish(event, "started", at)
                self._writer.publish(event, "lost", at)

    def _take(self) -> list[Effect]:
        if not self._writer.effects:
            return []
        for effect in self._writer.effects:  # of which there may be more meanwhile
            if isinstance(effect, EventOutcome):
                self._live.pop(effect.id, None)
            elif isinstance(effect, Mishap):
                self._lose_untold(effect.actor, effect.at)
        return self._writer.take()

    # -- what the robot does ------------------------------------------------------------------------------------

    def _robot_begins(self, began: ActionBegan, at: Seconds) -> None:
        if not self._history.is_new(began, at):
            return
        if began.action == "look":
            self._robot_looks(began.targets, at)
            return
        self._robot_actions[began.behavior, began.action] = began
        listens = self.scene.is_listening(began.behavior)
        self._heard_at = None if began.action == "speak" else self._heard_at
        # A listener's word is a sign and no speech: it has no floor, answers nobody, and nobody speaks into it.
        if began.action in ("nod", "shake", "point") or (listens and began.action == "speak"):
            self._say(began, at, lambda talk: talk.robot_gestures(began.action, at, listens=listens))
        elif began.action == "speak" and self.scene.robot_speaks_since is None:
            self._robot_speaks(began, at)
            self._say(began, at, lambda talk: talk.robot_speaks(at))
        part = PARTS.get(began.action, "rest")
        self._people.apply_to_all(at, lambda person: person.tell(lambda kind: kind.robot_begins(began, at)), part)

    def _robot_speaks(self, began: ActionBegan, at: Seconds) -> None:
        self.scene.speaks(self.robot)
        self.scene.robot_spoken = Spoken(actor=self.robot, since=at, to=self.addressees_of(began.behavior) or WHOEVER)
        self.scene.note_spoken(self.scene.robot_spoken, at)

    def _say(self, action: ActionBegan | ActionEnded, at: Seconds, step: Step) -> None:
        """Tell what the robot says or shows to those to whom it is; to all if that is not known."""
        to = self.addressees_of(action.behavior)
        for actor in ("",) if to is None else sorted(to):
            self._tell(actor, at, step)

    def addressees_of(self, behavior: str) -> Addressees | None:
        """Addressees of a behavior of the robot, `block:behavior`; None: they are not known."""
        block = behavior.rpartition(":")[0]
        if block in self._addressed:
            return self._addressed[block]
        return None if self.scene.turn is None else self.scene.turn[1]

    def announce(self, observation: Observation) -> None:
        """Learn to whom a block of the robot is. It may be called before the observation itself is fed."""
        match observation:
            case RequestEvent(event=Event(responder=actor), block=block):
                pass
            case SignalTurn(signal=TurnSignal(signal="answered" | "repaired", actor=str(actor)), block=block):
                pass
            case _:
                return
        if actor and block:
            self._addressed[block] = self._addressed.get(block, frozenset()) | {actor}

    def _robot_goes_on(self, began: ActionBegan, since: Seconds, at: Seconds) -> None:
        """Take an action of the robot that goes on: it answers a person who waits, and begins nothing else."""
        self._history.is_new(began, since)  # its beginning is no news any more
        if began.action == "look":
            if self.scene.gaze.targets and since < self.scene.gaze.since:
                return  # there is a newer one
            self._robot_looks(began.targets, max(since, self.scene.gaze.since))
            return
        self._robot_actions[began.behavior, began.action] = began
        if self.scene.is_listening(began.behavior):
            return
        if began.action == "speak" and self.scene.robot_speaks_since is None:
            self._heard_at = None
            self._robot_speaks(began, since)
        self._say(began, at, lambda talk: talk.robot_goes_on(began.action, since))

    def _robot_ends(self, ended: ActionEnded, at: Seconds) -> None:
        action = ended.action
        if not self._history.is_new(ended, at):
            return
        self._robot_actions.pop((ended.behavior, action), None)
        if action == "look":
            self.scene.gaze.end(ended.targets, at)
            self._note_robot_gaze()
            return
        if action == "speak":
            if self.scene.robot_speaks_since is None:
                self._say(ended, at, lambda talk: talk.robot_gesture_ends("speak", at))
                return
            if any(each == "speak" for _, each in self._robot_actions):
                return
            self.scene.robot_falls_silent(at)
        self._people.apply_to_all(
            at,
            lambda person: person.tell(lambda kind: kind.robot_stops(action, at)),
            "rest",
            lambda person: person.is_involved,
        )

    def _understand(self, words: Worded, at: Seconds) -> None:
        """Take the words of a person's speech, and to whom perception says that they are."""
        if words.is_line:
            self.scene.lines[words.actor] = words.since
        if words.to is not None:
            self.scene.tells_addressees = True
            self.scene.told_addressees[words.actor, words.since] = words.to
        if words.is_echo:
            self.scene.echoes[words.actor, words.since] = None
        elif words.text or words.is_announced:
            self.scene.echoes.pop((words.actor, words.since), None)
        self.scene.is_worded |= words.is_announced or (bool(words.text) and not words.is_line)
        if words.text:
            self._writer.understand(words.actor, words.since, words.text, at)
        if words.actor in self.persons:
            self._people.apply(
                words.actor, at, lambda person: person.talk.understand(words.since, words.text, words.to, at)
            )

    def _robot_is_heard(self, state: RobotState, at: Seconds) -> None:
        """End speech with a lost end: the body showed that it speaks, and for `SILENCE` no longer does."""
        if state.speaking:
            self._heard_at = at
        elif self._heard_at is not None and at > self._heard_at + SILENCE:
            self._heard_at = None
            self._robot_stops(at, actions=("speak",))

    def _robot_stops(self, at: Seconds, behaviors: str = "", actions: Container[Action] = get_args(Action)) -> None:
        """End speech and gestures of the robot, because reports of their ends may be lost.

        behaviors: only those with this prefix of the id. actions: only these.
        """
        for began in list(self._robot_actions.values()):
            if began.behavior.startswith(behaviors) and began.action in actions:
                ended = ActionEnded(
                    actor=self.robot, action=began.action, at=began.at, targets=began.targets, behavior=began.behavior
                )
                self._robot_ends(ended, at)

    def _robot_looks(self, targets: tuple[str, ...], at: Seconds) -> None:
        is_change = self.scene.gaze.begin(targets, at)
        self._note_robot_gaze()
        if is_change:
            self._robot_gaze_changed(at)

    def _note_robot_gaze(self) -> None:
        """Note when the robot's look is over, unless the same look begins again."""
        due = self.scene.gaze.deadline
        self._agenda.set(self.robot, None if due == inf else due)

    def _robot_gaze_changed(self, at: Seconds) -> None:
        self._people.apply_to_all(at, lambda person: person.gazes.gaze_changed(at), "looks", _has_gaze_under_way)

    # -- requests -----------------------------------------------------------------------------------------------

    def _request(self, request: RequestEvent, at: Seconds) -> None:
        """Accept and begin, or refuse, a robot-initiated event (thesis Fig. 5.2)."""
        if request.id in self._live:
            return
        fault = self._fault_in(request)
        if fault is not None:
            self._writer.effects.append(Refused(id=request.id, fault=fault))
            return
        wanted = request.event
        default = self.persons[wanted.responder].recognizer(wanted.kind).limit(wanted)
        event = OngoingEvent(
            kind=wanted.kind, initiator=self.robot, responder=wanted.responder, started=at, objects=wanted.objects,
            cause=wanted.cause, optional=wanted.optional, block=request.block, behavior=wanted.id, turn=wanted.turn,
            request=request.id, limit=None if default is None else wanted.limit or default,
            accept=wanted.accept or ACCEPT,
        )  # fmt: skip
        self._writer.effects.append(Accepted(id=request.id, within=self._within(event, wanted)))
        clock = self._clock(event, wanted)
        self._live[request.id] = event, clock
        self.announce(request)
        self._people.apply(wanted.responder, at, lambda person: self._begin(person, event, clock))

    def _begin(self, person: PersonRecognition, event: OngoingEvent, clock: LimitClock | None) -> None:
        """Begin the robot's event with this person."""
        opens_turn = event.kind == "adjacency_pair"
        ended = self._begins_turn(event) if opens_turn else self.blocks.ended.get(event.block)
        person.recognizer(event.kind).robot_asks(event, clock, ended)

    def _waiting_for(self, block: str, name: str) -> Iterable[str]:
        """Persons with a time limit that runs from this sync point of a block of the robot."""
        return dict.fromkeys(
            event.responder
            for event, clock in self._live.values()
            if clock is not None
            and event.block == block
            and clock.waits_for(name)
            and event.responder in self.persons
        )

    def _fault_in(self, request: RequestEvent) -> Fault | None:
        event, where = request.event, f"{request.block}: {request.event.id}"
        person = self.persons.get(event.responder)
        if person is None:
            known = ", ".join(sorted(self.persons)) or "nobody"
            return Fault(reason=f"unknown actor {event.responder!r}", where=where, advice=f"known: {known}")
        if not person.presence.here:
            reason = f"{event.responder!r} is not seen any more"
            return Fault(reason=reason, where=where, cause="gone", whose=event.responder)
        kind = EVENT_KINDS[event.kind]
        if kind.needs_objects and not event.objects:
            return Fault(reason=f"{kind.title} without objects", where=where)
        unknown = [name for name in event.objects if not self.scene.knows(name)]
        if event.turn and event.turn in self._aborted_turns:
            reason = f"turn {event.turn!r} has been cut off"  # nobody but generation says so
            return Fault(reason=reason, where=where, cause="cancelled", whose="generation")
        if unknown:
            return Fault(reason=f"unknown object {', '.join(map(repr, unknown))}", where=where)
        if event.limit is not None and not event.limit > 0:
            return Fault(reason=f"limit must be greater than 0 s, not {event.limit}", where=where)
        return None

    def _within(self, event: OngoingEvent, wanted: Event) -> Seconds:
        """Longest time from the robot's last deed to the decision, also if the turn's end or anchors never come."""
        offsets = [found[1] for text in wanted.anchors if (found := anchor(text)) is not None]
        limit = max(event.limit or 0.0, self._config.backchannel_limit)
        is_open = self.in_company or self.scene.is_worded
        unknown = self.scene.longest_unknown + WORDS_AFTER if is_open else 0.0
        return limit + TURN_PATIENCE + max([0.0, *offsets]) + unknown + SETTLING

    def _clock(self, event: OngoingEvent, wanted: Event) -> LimitClock | None:
        """Clock of the event's limit; None: it has none."""
        if event.limit is None:
            return None
        clock = LimitClock(event.started, event.limit, wanted.anchors, TURN_PATIENCE)
        for name in clock.waiting:
            if (realised := self.blocks.point(event.block, name)) is not None:
                clock.realised(name, realised)
        if (ended := self.blocks.ended.get(event.block)) is not None:
            clock.stop_waiting(ended)
        return clock

    def _begins_turn(self, event: OngoingEvent) -> Seconds | None:
        """Note the first turn of a pair, and whether it is to others, too. Returns when it was over, if it is."""
        live = (each for each, _ in self._live.values())
        asked = [each for each in live if each.kind == "adjacency_pair" and each.turn == event.turn]
        for each in asked if event.turn and len(asked) > 1 else ():
            each.is_to_several = True
        self._speaks_to(event.responder, event.block, event.started)
        ended = self._ended_turns.get(event.turn) if event.turn else self.blocks.ended.get(event.block)
        if ended is None:
            self._opens(event.turn, event.responder)
        return ended

    def _speaks_to(self, actor: str, block: str, at: Seconds) -> None:
        """Note another addressee of what the robot says in this block already: it has announced them one by one."""
        said = self.scene.robot_spoken
        speaks = any(name.startswith(f"{block}:") and action == "speak" for name, action in self._robot_actions)
        if speaks and actor and said is not None and said.to is not None and not said.is_to(actor):
            said.to |= {actor}
            self.scene.floor_changes += 1
            self._tell(actor, at, lambda talk: talk.robot_speaks(max(said.since, at)))

    def _opens(self, turn: str, addressee: str) -> None:
        """Note a turn of the robot that goes on over several blocks."""
        if turn and addressee:
            before = self.scene.turn[1] if self.scene.turn is not None and self.scene.turn[0] == turn else frozenset()
            self.scene.turn = (turn, before | {addressee})

    def _closes(self, turn: str) -> None:
        if self.scene.turn is not None and self.scene.turn[0] == turn:
            self.scene.turn = None

    def _cancel(self, cancel: Cancel, at: Seconds) -> None:
        event, _ = self._live.pop(cancel.id, (None, None))
        if event is not None and event.request == cancel.id:
            is_orphan = cancel.cause in ORPHANING
            who = event.initiator if event.responder == self.robot else event.responder
            self._people.apply(
                who, at, lambda person: person.recognizer(event.kind).withdraw(event, at, is_orphan=is_orphan)
            )

    # -- turns and blocks ---------------------------------------------------------------------------------------

    def _signal(self, request: SignalTurn, at: Seconds) -> None:
        """Take a signal about a turn, and answer the request at once."""
        signal = request.signal
        match signal.signal:
            case "ended":
                self._ended_turns[signal.turn] = at
                self._closes(signal.turn)
                self._tell(signal.actor, at, lambda talk: talk.turn_ended(signal.turn, at))
            case "answered" | "repaired":
                repairs = signal.signal == "repaired"
                self.announce(request)
                self._opens(signal.turn, signal.actor)
                self._speaks_to(signal.actor, request.block, at)
                self._tell(signal.actor, at, lambda talk: talk.is_answered(at, repairs=repairs))
                if request.block and request.block not in self.blocks.ended:
                    self._answering_blocks[request.block] = signal.actor
            case "aborted":
                self._aborted_turns[signal.turn] = at
                self._closes(signal.turn)
                self._abort(signal.actor, at, signal.turn)
        self._writer.effects.append(TurnOutcome(id=request.id, at=self._writer.stamp(at)))

    def _abort(self, actor: str, at: Seconds, turn: str) -> None:
        """End the pairs of a turn that was cut off; first of those who have cut in, who may answer for all."""
        self._tell(actor, at, lambda talk: talk.cut_off(at, turn=turn))
        self._apply_to_addressees(actor, at, lambda person: person.abort(at, turn=turn))

    def _apply_to_addressees(
        self, actor: str, at: Seconds, step: Callable[[PersonRecognition], object], part: Part = "all"
    ) -> None:
        """Apply a step to a known person, or to all (actor: empty). part: what it may change."""
        if not actor:
            self._people.apply_to_all(at, step, part)
        elif actor in self.persons:
            self._people.apply(actor, at, step, part)

    def _tell(self, actor: str, at: Seconds, step: Step) -> None:
        """Tell what happens to the conversation with a known person, or with all (actor: empty)."""
        self._apply_to_addressees(actor, at, lambda person: person.talk.take(at, step), "rest")

    def _point_realised(self, point: SyncPointProgress, at: Seconds) -> None:
        block = point.block
        name = self.blocks.realised(block, point.behavior, point.sync, at)
        for id in self._waiting_for(block, name):
            self._people.apply(id, at, lambda person: person.tell(lambda kind: kind.point_realised(block, name, at)))

    def _block_progresses(self, told: BlockProgress, at: Seconds) -> None:
        if told.block is not None and told.progress == "start":
            self._block_begins(told.block, at)
        elif told.block is not None and told.progress == "end":
            self._block_ended(told.block, at, aborted=told.status in ("failed", "interrupted"))

    def _block_begins(self, block: str, at: Seconds) -> None:
        """Forget an earlier block of this id, and an earlier turn: a turn is called like the block that opens it."""
        self.blocks.begin(block, at)
        for turns in (self._ended_turns, self._aborted_turns):
            if turns.get(block, at) < at:
                del turns[block]

    def _block_ended(self, block: str, at: Seconds, *, aborted: bool) -> None:
        self.blocks.ended[block] = at
        self.scene.listening_blocks.pop(block, None)
        self._robot_stops(at, f"{block}:")
        self._people.apply_to_all(
            at,
            lambda person: person.tell(lambda kind: kind.block_ended(block, at, aborted=aborted)),
            where=lambda person: person.is_involved,
        )
        answered = self._answering_blocks.pop(block, None)
        if answered is not None:
            self._tell(answered, at, lambda talk: talk.exchange.pair.answered_block_ended(at))


def _has_gaze_under_way(person: PersonRecognition) -> bool:
    return person.gazes.is_under_way
