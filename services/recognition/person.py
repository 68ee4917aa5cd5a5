"""One person and the robot: what each does becomes input of the four recognizers between them."""

from collections.abc import Callable, Iterator
from functools import partial
from typing import NamedTuple

from schemas.behaviors import Action, Cause, EventKind
from schemas.units import Probability, Seconds
from services.recognition.adjacency_pair import AdjacencyPair
from services.recognition.backchannel import BRIEF, UNDECIDED, Backchannel
from services.recognition.config import RecognitionConfig
from services.recognition.directed_gaze import HUMAN_DIRECTING, DirectedGaze
from services.recognition.limits import LimitClock
from services.recognition.machine import IDLE, Ledger, UnderWay
from services.recognition.mutual_facial_gaze import HUMAN_WAITING, MutualFacialGaze
from services.recognition.presence import Presence
from services.recognition.scene import Gaze, Scene
from services.recognition.shared_gaze import SharedGaze


class Due(NamedTuple):
    """Something that happens by itself at `at`."""

    at: Seconds
    happen: Callable[[Seconds], None]


class _Directed(NamedTuple):
    """A directed gaze of the robot that is over."""

    objects: tuple[str, ...]
    at: Seconds


class Person:
    """The recognizers of one actor. strict: undefined transitions raise."""

    def __init__(self, id: str, scene: Scene, config: RecognitionConfig, ledger: Ledger, *, strict: bool) -> None:
        self.id = id
        self.presence = Presence(config.lost_face_grace)
        self.gaze = Gaze()
        self.speaks_since: Seconds | None = None
        self.silent_since: Seconds | None = None
        self.acts_since: Seconds | None = None
        self._speech_confidence: Probability = 1.0
        self.directed: list[DirectedGaze] = []
        self.facial = MutualFacialGaze(ledger, strict=strict)
        self.pair = AdjacencyPair(
            ledger, limit=config.adjacency_pair_limit, patience=config.turn_patience, strict=strict
        )
        self.own_backchannel = Backchannel(ledger, limit=config.backchannel_limit, strict=strict)
        self.robot_backchannel = Backchannel(ledger, limit=config.backchannel_limit, strict=strict)
        self._scene = scene
        self._config = config
        self._ledger = ledger
        self._strict = strict
        self._robot_directed: list[_Directed] = []

    # -- time ---------------------------------------------------------------------------------------------------

    def first_due(self) -> Due | None:
        """What will happen by itself first, unless something comes in between."""
        first: Due | None = None
        candidates: tuple[tuple[Seconds | None, Callable[[Seconds], None]], ...] = (
            (self.gaze.deadline, self._gaze_expires),
            (self.presence.deadline, self._gone),
            *((one.deadline, partial(self._expire_directed, one)) for one in self.directed),
            (self.facial.deadline, self.facial.expire),
            (self.own_backchannel.deadline, self._takes_floor),
            (self.robot_backchannel.deadline, self._robot_takes_floor),
            (self.pair.deadline, self.pair.expire),
            (self._look_directs_at, self._look_directs),
        )
        for at, happen in candidates:
            if at is not None and (first is None or at < first.at):
                first = Due(at, happen)
        return first

    @property
    def _look_directs_at(self) -> Seconds | None:
        """When this look will have lasted long enough to direct the robot's, if nothing changes."""
        if self.gaze.spent or self.gaze.ended is not None or self.acts_since is not None:
            return None
        if not any(map(self._scene.is_object, self.gaze.targets)):
            return None
        silent_since = self._scene.others_silent_since(self.id)
        return None if silent_since is None else max(self.gaze.since, silent_since) + self._config.direct_by_look

    def _gone(self, at: Seconds) -> None:
        """Close whatever is open with this person."""
        until = self.presence.leave()
        for one in self.directed:
            one.person_gone(at, until)
        self.forget_idle(at)
        self.facial.person_gone(at, until)
        self.pair.person_gone(at, until)
        self.own_backchannel.person_gone(at, until)
        self.robot_backchannel.person_gone(at, until)
        self.gaze = Gaze(since=until)
        self.speaks_since = self.acts_since = None
        self.silent_since = until
        self._scene.falls_silent(self.id, until)

    # -- gaze ---------------------------------------------------------------------------------------------------

    @property
    def on_robots_face(self) -> bool:
        return self._scene.robot in self.gaze.targets

    def looks(self, targets: tuple[str, ...], at: Seconds, confidence: Probability = 1.0) -> None:
        was_on_face = self.on_robots_face
        if not self.gaze.begin(targets, at, confidence):
            return
        self.gaze_changed(at)
        if self.on_robots_face and not was_on_face and self.facial.state == IDLE:
            self._human_looks_at_face(at)

    def looks_away(self, targets: tuple[str, ...], at: Seconds) -> None:
        self.gaze.end(targets, at)

    def _gaze_expires(self, at: Seconds) -> None:
        self.gaze_changed(self.gaze.expire())

    def gaze_changed(self, at: Seconds) -> None:
        """The person's or the robot's gaze is elsewhere now."""
        confidence = self.gaze.confidence
        robot_on = self._scene.robot_looks_at((self.id,))
        self.facial.gazes(robot_on=robot_on, human_on=self.on_robots_face, at=at, confidence=confidence)
        for one in self.directed:
            human_on = self._scene.person_looks_at(self.gaze, one.objects)
            if human_on and one.event is not None and one.event.cause != "human":
                self.gaze.spent = True
            robot_on = self._scene.robot_looks_at(one.objects)
            one.gazes(robot_on=robot_on, human_on=human_on, at=at, confidence=confidence)
        self.forget_idle(at)
        if any(
            self._scene.person_looks_at(self.gaze, past.objects) and at - past.at <= self._config.after_robot_directed
            for past in self._robot_directed
        ):
            self.gaze.spent = True
        self.hands_changed()

    def hands_changed(self) -> None:
        """What the person's hands hide may be on the move: a look that goes with it directs nothing."""
        self.gaze.spent = self.gaze.spent or self._scene.goes_with_hand(self.id, self.gaze.targets)

    def head_owner_changed(self, at: Seconds) -> None:
        """What the robot can no longer answer, because its fragment looks elsewhere, is preempted."""
        if self.facial.state == HUMAN_WAITING and self._scene.fragment_looks_elsewhere((self.id,)):
            self.facial.step("fragment_takes_head", at)
        for one in self.directed:
            if one.state == HUMAN_DIRECTING and self._scene.fragment_looks_elsewhere(one.objects):
                one.step("fragment_takes_head", at)
        self.forget_idle(at)

    def gaze_machines(self) -> Iterator[SharedGaze]:
        yield self.facial
        yield from self.directed

    def _human_looks_at_face(self, at: Seconds) -> None:
        limit = self._config.mutual_facial_gaze_limit
        event = self._by_human("mutual_facial_gaze", at, limit, self.gaze.confidence)
        self.facial.human_begins(
            event,
            LimitClock(at, limit),
            robot_since=self._scene.robot_since((self.id,)),
            human_on=True,
            in_vain=self._scene.fragment_looks_elsewhere((self.id,)),
            at=at,
        )

    # -- directed gaze ------------------------------------------------------------------------------------------

    def points(self, targets: tuple[str, ...], at: Seconds, confidence: Probability = 1.0) -> None:
        objects = tuple(filter(self._scene.is_object, targets))
        if objects:
            self._human_directs(objects, at, at, confidence)
        self.pair.human_begins("point", at, confidence)

    def _look_directs(self, at: Seconds) -> None:
        self.gaze.spent = True
        objects = tuple(filter(self._scene.is_object, self.gaze.targets))
        self._human_directs(objects, at - self._config.direct_by_look, at, self.gaze.confidence)

    def _human_directs(self, objects: tuple[str, ...], since: Seconds, at: Seconds, confidence: Probability) -> None:
        """since: start of the pointing, or of the look that has become a direction at `at`."""
        if any(set(one.objects) & set(objects) for one in self.directed):
            return
        limit = self._config.directed_gaze_limit
        event = self._by_human("directed_gaze", since, limit, confidence, objects)
        in_vain = self._scene.fragment_looks_elsewhere(objects)
        robot_since = self._scene.robot_since(objects)
        if robot_since is not None or not in_vain:
            self.facial.directed_gaze_begins(at, by_robot=False)
        human_on = self._scene.person_looks_at(self.gaze, objects)
        one = DirectedGaze(self._ledger, objects, strict=self._strict)
        self.directed.append(one)
        clock = LimitClock(since, limit)
        one.human_begins(event, clock, robot_since=robot_since, human_on=human_on, in_vain=in_vain, at=at)
        self.gaze.spent = self.gaze.spent or human_on
        self.forget_idle(at)

    def robot_directs(self, event: UnderWay, clock: LimitClock) -> DirectedGaze:
        for one in self.directed:
            if set(one.objects) == set(event.objects):
                one.supersede(event.started)
        self.forget_idle(event.started)
        self.facial.directed_gaze_begins(event.started, by_robot=True)
        one = DirectedGaze(self._ledger, event.objects, strict=self._strict)
        self.directed.append(one)
        there = self._scene.person_looks_at(self.gaze, event.objects)
        self.gaze.spent = self.gaze.spent or there
        robot_on = self._scene.robot_looks_at(event.objects)
        one.robot_begins(event, clock, robot_on=robot_on, look=self.gaze if there else None)
        self.forget_idle(event.started)
        return one

    def _expire_directed(self, one: DirectedGaze, at: Seconds) -> None:
        one.expire(at)
        self.forget_idle(at)

    def forget_idle(self, at: Seconds) -> None:
        """Drop finished directed gazes; the robot's are remembered for a while."""
        recent = self._config.after_robot_directed
        self._robot_directed = [past for past in self._robot_directed if at - past.at <= recent]
        for one in self.directed:
            if one.state == IDLE and one.by_robot:
                self._robot_directed.append(_Directed(one.objects, at))
        self.directed = [one for one in self.directed if one.state != IDLE]

    # -- mutual facial gaze -------------------------------------------------------------------------------------

    def robot_looks_at_face(self, event: UnderWay, clock: LimitClock) -> None:
        self.facial.supersede(event.started)
        robot_on = self._scene.robot_looks_at((self.id,))
        self.facial.robot_begins(event, clock, robot_on=robot_on, look=self.gaze if self.on_robots_face else None)

    # -- speech and gestures ------------------------------------------------------------------------------------

    @property
    def robot_holds_floor(self) -> bool:
        return self._scene.robot_speaks_since is not None or self.pair.robot_holds_turn

    @property
    def holds_floor(self) -> bool:
        return self.speaks_since is not None

    def speaks(self, at: Seconds, confidence: Probability = 1.0) -> None:
        if self.speaks_since is not None:
            return
        self.speaks_since, self.silent_since = at, None
        self._scene.speaks(self.id)
        self._speech_confidence = confidence
        if self.robot_holds_floor:
            self.own_backchannel.speaks(self._backchannel(self._scene.robot, self.id, at, confidence))
        else:
            self._human_turn(at, "speak", confidence)

    def falls_silent(self, at: Seconds) -> None:
        if self.speaks_since is None:
            return
        self.speaks_since, self.silent_since = None, at
        self._scene.falls_silent(self.id, at)
        self._backchannel_speech_ends(self.own_backchannel, at)
        self._floor_is_free(at)
        self.pair.ends("speak", at, by_robot=False)

    def gestures(self, action: Action, at: Seconds, confidence: Probability = 1.0) -> None:
        """A nod or a shake."""
        if self.robot_holds_floor and self.own_backchannel.state != UNDECIDED:
            self.own_backchannel.gestures(self._backchannel(self._scene.robot, self.id, at, confidence))
        else:
            self.pair.human_begins(action, at, confidence)

    def gesture_ends(self, action: Action, at: Seconds) -> None:
        if self.own_backchannel.state == BRIEF:
            self.own_backchannel.ends(at)
        self.pair.ends(action, at, by_robot=False)

    def manipulates(self, at: Seconds, confidence: Probability = 1.0) -> None:
        if self.acts_since is None:
            self.acts_since = at
            self._human_turn(at, "act", confidence)

    def manipulation_ends(self, at: Seconds) -> None:
        self.acts_since = None
        self.gaze.spent = True
        self.pair.ends("act", at, by_robot=False)

    def _human_turn(self, at: Seconds, action: Action, confidence: Probability) -> None:
        """Speech that is no backchannel, or a manipulation: an answer, more of the same turn, or a first turn."""
        pair = self.pair
        if pair.human_begins(action, at, confidence) or pair.human_goes_on(action, at):
            pass
        elif action == "speak" and pair.is_third_turn(self.id, at):
            pair.third_turn(at)
        elif pair.state == IDLE:
            event = self._by_human("adjacency_pair", at, self._config.adjacency_pair_limit, confidence)
            pair.human_asks(event, action)
        if action == "speak" and self.speaks_since is None and self.silent_since is not None:
            pair.ends("speak", self.silent_since, by_robot=False)

    def robot_speaks(self, at: Seconds) -> None:
        self.pair.robot_heard(None)
        if self.holds_floor:
            if self.robot_backchannel.state != BRIEF:
                self.robot_backchannel.speaks(self._backchannel(self.id, self._scene.robot, at))
        else:
            self.pair.robot_begins("speak", at)

    def robot_falls_silent(self, at: Seconds) -> None:
        self.pair.robot_heard(at)
        self._backchannel_speech_ends(self.robot_backchannel, at)
        self.pair.ends("speak", at, by_robot=True)
        self._floor_is_free(at)

    def robot_gestures(self, action: Action, at: Seconds) -> None:
        """A nod, a shake, or pointing: the robot's."""
        if not self.holds_floor or action == "point":
            self.pair.robot_begins(action, at)
        elif self.robot_backchannel.state == IDLE:
            self.robot_backchannel.gestures(self._backchannel(self.id, self._scene.robot, at))

    def robot_gesture_ends(self, action: Action, at: Seconds) -> None:
        if self.robot_backchannel.state == BRIEF and action != "point":
            self.robot_backchannel.ends(at)
        self.pair.ends(action, at, by_robot=True)

    def turn_ends(self, at: Seconds) -> None:
        self.pair.turn_ends(at)
        self._floor_is_free(at)

    def _backchannel_speech_ends(self, backchannel: Backchannel, at: Seconds) -> None:
        since = backchannel.undecided_since
        if backchannel.state == BRIEF or (since is not None and at - since <= self._config.backchannel_limit):
            backchannel.ends(at)

    def _floor_is_free(self, at: Seconds) -> None:
        """Speech that outlasts the turn in which it began is a turn of its own."""
        if self.own_backchannel.state == UNDECIDED and not self.robot_holds_floor:
            self._takes_floor(at, "outlasts_turn")
        if self.robot_backchannel.state == UNDECIDED and not self.holds_floor:
            self._robot_takes_floor(at, "outlasts_turn")

    def _robot_takes_floor(self, at: Seconds, given: str = "limit") -> None:
        self.pair.robot_begins("speak", self.robot_backchannel.takes_floor(given, at))

    def _takes_floor(self, at: Seconds, given: str = "limit") -> None:
        """The person's speech is no backchannel after all, but a turn since it began."""
        self._human_turn(self.own_backchannel.takes_floor(given, at), "speak", self._speech_confidence)

    def abort(self, at: Seconds, *, turn: str) -> None:
        """The robot's turn was cut off: what it asked for is taken back."""
        if self.pair.is_turn(turn):
            self.pair.abort(at)
            self._floor_is_free(at)
        for machine in self.gaze_machines():
            if machine.event is not None and turn and machine.event.turn == turn:
                machine.block_ended(at, aborted=True)
        self.forget_idle(at)

    def block_ended(self, block: str, at: Seconds, *, aborted: bool) -> None:
        for machine in self.gaze_machines():
            if machine.event is not None and machine.event.block == block:
                machine.block_ended(at, aborted=aborted)
        self.forget_idle(at)
        self.pair.block_ended(block, at, aborted=aborted)
        announced = self.robot_backchannel.event
        if announced is not None and announced.block == block:
            self.robot_backchannel.ends(at)
        self._floor_is_free(at)

    def robot_asks(self, event: UnderWay) -> None:
        if self.robot_backchannel.state == UNDECIDED:
            self.robot_backchannel.takes_floor("outlasts_turn", event.started)
        self.pair.robot_asks(event)
        if self._scene.robot_speaks_since is not None:
            self.pair.robot_heard(None)

    # -- new events ---------------------------------------------------------------------------------------------

    def _by_human(
        self, kind: EventKind, at: Seconds, limit: Seconds, confidence: Probability, objects: tuple[str, ...] = ()
    ) -> UnderWay:
        return UnderWay(
            kind=kind, initiator=self.id, responder=self._scene.robot, started=at, limit=limit, objects=objects,
            confidence=confidence,
        )  # fmt: skip

    def _backchannel(self, speaker: str, listener: str, at: Seconds, confidence: Probability = 1.0) -> UnderWay:
        cause: Cause = "human" if listener == self.id else "turn"
        return UnderWay(
            kind="backchannel", initiator=speaker, responder=listener, started=at, cause=cause, confidence=confidence
        )
