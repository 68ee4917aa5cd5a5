"""One person and the robot: the actions of each become input of the four recognizers between them."""

from collections.abc import Callable, Iterator
from functools import partial
from typing import NamedTuple

from engage_hri.schemas.behaviors import Action, EventKind
from engage_hri.schemas.perception import ActionBegan, ActionEnded
from engage_hri.schemas.units import Probability, Seconds
from engage_hri.services.recognition.config import RecognitionConfig
from engage_hri.services.recognition.events.directed_gaze import HUMAN_DIRECTING, DirectedGaze
from engage_hri.services.recognition.events.history import ActionHistory
from engage_hri.services.recognition.events.limits import LimitClock, in_time
from engage_hri.services.recognition.events.machine import IDLE, EventWriter, OngoingEvent
from engage_hri.services.recognition.events.mutual_facial_gaze import HUMAN_WAITING, MutualFacialGaze
from engage_hri.services.recognition.events.presence import FacePresence
from engage_hri.services.recognition.events.scene import GazeState, SessionScene
from engage_hri.services.recognition.events.shared_gaze import SharedGaze
from engage_hri.services.recognition.events.talk import Talk

DIRECT_BY_LOOK: Seconds = 0.6
"""Time for which a person looks at an object before that directs the robot's gaze: a shorter look takes in the scene.
Less than the time for which an absent person is remembered. Ours."""
AFTER_ROBOT_DIRECTED: Seconds = 2.0
"""Time after a robot's directed gaze in which a look at the same object is no direction of its own, but a late
response. Less than the time for which an absent person is remembered. Ours."""
LONGEST_SPEECH: Seconds = 60.0
"""Time after which speech is over if no report of its end has come. The next beginning ends it, too. Ours."""
LONGEST_GESTURE: Seconds = 10.0
"""The same for a nod, a shake or a point. Ours."""
LONGEST_MANIPULATION: Seconds = 120.0
"""The same for a manipulation. Ours."""
ACTIONS_KEPT = 64
"""Number of actions of each person for which it is remembered when they last began and ended."""


class _Directed(NamedTuple):
    """A directed gaze of the robot that is over."""

    objects: tuple[str, ...]
    at: Seconds


class _Doing(NamedTuple):
    """An action that a person performs. until: time at which it is over if no report of its end has come."""

    targets: tuple[str, ...]
    since: Seconds
    until: Seconds


class PersonRecognition:
    """The recognizers of one person. number: position in the order of acquaintance."""

    def __init__(
        self, id: str, number: int, scene: SessionScene, config: RecognitionConfig, writer: EventWriter
    ) -> None:
        self.id = id
        self.number = number
        self.presence = FacePresence()
        self.gaze = GazeState()
        self.directed: list[DirectedGaze] = []
        self.facial = MutualFacialGaze(writer)
        self.talk = Talk(id, scene, config, writer)
        self.history = ActionHistory(ACTIONS_KEPT)
        self._doing: dict[Action, _Doing] = {}
        """Present actions other than looking."""
        self._scene = scene
        self._config = config
        self._writer = writer
        self._robot_directed: list[_Directed] = []

    # -- time ---------------------------------------------------------------------------------------------------

    @property
    def deadline(self) -> Seconds | None:
        """Time of the next step that is due by itself, unless an input comes before; then call `pass_time`."""
        times = [self.presence.deadline, *self.talk.deadlines]
        if self.gaze.targets:
            times += self.gaze.deadline, self.look_directs_at
        if self.facial.event is not None:
            times.append(self.facial.deadline)
        for directed in self.directed:
            times.append(directed.deadline)
        for doing in self._doing.values():
            times.append(doing.until)
        known = [at for at in times if at is not None]
        return min(known) if known else None

    @property
    def _timed_steps(self) -> Iterator[tuple[Seconds | None, Callable[[Seconds], None]]]:
        """Steps with their times, in the order in which they happen if the times are equal."""
        yield self.gaze.deadline, self._gaze_expires
        yield self.presence.deadline, self.leave
        yield from ((one.deadline, partial(self._expire_directed, one)) for one in self.directed)
        yield self.facial.deadline, self.facial.expire
        yield from self.talk.timed_steps
        yield self.look_directs_at, self._look_directs
        yield from ((one.until, self._goes_on_too_long) for one in self._doing.values())

    @property
    def has_gaze_event(self) -> bool:
        """True if a gaze event goes on, or the robot has just directed the person's gaze."""
        return self.facial.event is not None or bool(self.directed or self._robot_directed)

    @property
    def is_involved(self) -> bool:
        """True if anything goes on between the person and the robot that the robot's deeds may change."""
        return self.has_gaze_event or self.talk.is_under_way

    def pass_time(self, at: Seconds) -> None:
        """Take the first step that is due at `at`. There is none if something that all share has put it off."""
        for due, step in self._timed_steps:
            if due == at:
                step(at)
                return

    @property
    def look_directs_at(self) -> Seconds | None:
        """Time at which the person's look has lasted long enough to direct the robot's; None if it does not."""
        gaze = self.gaze
        if not gaze.targets or gaze.spent or gaze.ended is not None or "act" in self._doing:
            return None
        if not any(map(self._scene.is_object, gaze.targets)):
            return None
        silent_since = self._scene.others_silent_since(self.id)
        return None if silent_since is None else max(self.gaze.since, silent_since) + DIRECT_BY_LOOK

    def leave(self, at: Seconds) -> None:
        """Count the person as gone, and close all its open events."""
        until = self.presence.leave()
        for one in self.directed:
            one.person_gone(at, until)
        self.forget_idle(at)
        self.facial.person_gone(at, until)
        self.talk.person_gone(at, until)
        self.gaze = GazeState(since=until)
        self._doing.clear()
        self._scene.stops(self.id, until)

    # -- what the person does -----------------------------------------------------------------------------------

    def begins(self, began: ActionBegan, at: Seconds) -> None:
        if not self.history.is_new(began, at) or not self.presence.seen(at):
            return
        action, targets, confidence = began.action, began.targets, began.confidence
        if action == "look":
            self.looks(targets, at, confidence)
            return
        if action in self._doing:
            if at < self._doing[action].since:
                return
            self._stops(action, at)  # its end has been lost
        self._doing[action] = _Doing(targets, at, at + self._longest(action))
        match action:
            case "point":
                self.points(targets, at, confidence)
            case "speak":
                self._scene.speaks(self.id)
                self.talk.speaks(at, confidence, self._face)
            case "nod" | "shake":
                self.talk.shows(at, self._face, lambda talk: talk.gestures(action, at, confidence))
            case "act":
                self._scene.acting.add(self.id)
                self.talk.shows(at, self._face, lambda talk: talk.manipulates(at, confidence))

    def goes_on(self, began: ActionBegan, since: Seconds, at: Seconds) -> None:
        """Take an action that goes on, known only now: it answers what waits for it, and begins nothing itself."""
        if not self.presence.seen(at):
            return
        self.history.is_new(began, since)  # its beginning is no news any more
        action, targets = began.action, began.targets
        if action == "look":
            if self.gaze.targets and since < self.gaze.since:
                return  # there is a newer one
            since = max(since, self.gaze.since)
            if self.gaze.begin(targets, since, began.confidence):
                self.gaze.spent = True
                self.gaze_changed(since)
        elif action not in self._doing:
            self._doing[action] = _Doing(targets, since, at + self._longest(action))
            if action == "act":
                self._scene.acting.add(self.id)
            if action == "speak":
                self._scene.speaks(self.id)
            self.talk.goes_on(action, since, at, began.confidence, self._face)

    def ends(self, ended: ActionEnded, at: Seconds) -> None:
        if not self.history.is_new(ended, at):
            return
        if ended.action == "look":
            self.gaze.end(ended.targets, at)
            return
        doing = self._doing.get(ended.action)
        if doing is not None and at >= doing.since and (not ended.targets or ended.targets == doing.targets):
            self._stops(ended.action, at)

    def _stops(self, action: Action, at: Seconds) -> None:
        del self._doing[action]
        match action:
            case "point":
                self.talk.take(at, lambda talk: talk.action_ends("point", at))
            case "speak":
                self._scene.falls_silent(self.id, at)
                self.talk.falls_silent(at)
            case "nod" | "shake":
                self.talk.take(at, lambda talk: talk.action_ends(action, at))
            case "act":
                self.gaze.spent = True
                self._scene.acting.discard(self.id)
                self.talk.take(at, lambda talk: talk.action_ends("act", at))

    def _longest(self, action: Action) -> Seconds:
        if action == "speak":
            return LONGEST_SPEECH
        return LONGEST_MANIPULATION if action == "act" else LONGEST_GESTURE

    def _goes_on_too_long(self, at: Seconds) -> None:
        """End actions with a lost end and no later beginning."""
        for action in [action for action, one in self._doing.items() if one.until <= at]:
            self._stops(action, at)

    # -- gaze ---------------------------------------------------------------------------------------------------

    @property
    def on_robots_face(self) -> bool:
        return self._scene.robot in self.gaze.targets

    @property
    def contact(self) -> Probability | None:
        """Contact with the robot now, from 0 to 1; None: nobody has told where the person looks."""
        targets = self.gaze.targets
        if self.presence.here and (
            self._scene.robot in targets
            or self.talk.speaks_to_robot
            or self.facial.is_shared
            or any(one.is_shared for one in self.directed)
        ):
            return 1.0
        return None if self.gaze.since == 0.0 and not targets else 0.0

    @property
    def _face(self) -> str:
        """Actor whose face the person looks at; "": none."""
        return next(filter(self._scene.is_face, self.gaze.targets), "")

    def looks(self, targets: tuple[str, ...], at: Seconds, confidence: Probability = 1.0) -> None:
        was_on_face = self.on_robots_face
        if not self.gaze.begin(targets, at, confidence):
            return
        self.gaze_changed(at)
        if self.on_robots_face and not was_on_face and self.facial.state == IDLE:
            self._human_looks_at_face(at)

    def _gaze_expires(self, at: Seconds) -> None:
        self.gaze_changed(self.gaze.expire())

    def gaze_changed(self, at: Seconds) -> None:
        """Pass a change of the person's or the robot's gaze on to the recognizers."""
        confidence = self.gaze.confidence
        self.talk.looks_at(self._face, at)
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
            self._scene.person_looks_at(self.gaze, past.objects) and self._is_recent(past, at)
            for past in self._robot_directed
        ):
            self.gaze.spent = True
        self.hands_changed()

    def hands_changed(self) -> None:
        """Mark a look that goes with the person's own hand, which may move a hidden piece: it directs nothing."""
        self.gaze.spent = self.gaze.spent or self._scene.goes_with_hand(self.id, self.gaze.targets)

    def head_owner_changed(self, at: Seconds) -> None:
        """Preempt events that the robot can no longer answer, because its fragment looks elsewhere."""
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
        in_vain, robot_since = self._scene.fragment_looks_elsewhere((self.id,)), self._scene.robot_since((self.id,))
        self.facial.human_begins(event, limit, robot_since=robot_since, human_on=True, in_vain=in_vain, at=at)

    # -- directed gaze ------------------------------------------------------------------------------------------

    def points(self, targets: tuple[str, ...], at: Seconds, confidence: Probability = 1.0) -> None:
        objects = tuple(filter(self._scene.is_object, targets))
        if objects:
            self._human_directs(objects, at, at, confidence)
        self.talk.shows(at, self._face, lambda talk: talk.gestures("point", at, confidence))

    def _look_directs(self, at: Seconds) -> None:
        self.gaze.spent = True
        objects = tuple(filter(self._scene.is_object, self.gaze.targets))
        self._human_directs(objects, at - DIRECT_BY_LOOK, at, self.gaze.confidence)

    def _human_directs(self, objects: tuple[str, ...], since: Seconds, at: Seconds, confidence: Probability) -> None:
        """Begin a directed gaze. since: start of the pointing, or of the look that has become a direction at `at`."""
        if any(set(one.objects) & set(objects) for one in self.directed):
            return
        limit = self._config.directed_gaze_limit
        event = self._by_human("directed_gaze", since, limit, confidence, objects)
        in_vain = self._scene.fragment_looks_elsewhere(objects)
        robot_since = self._scene.robot_since(objects)
        if robot_since is not None or not in_vain:
            self.facial.directed_gaze_begins(at, by_robot=False)
        human_on = self._scene.person_looks_at(self.gaze, objects)
        one = DirectedGaze(self._writer, objects)
        self.directed.append(one)
        one.human_begins(event, limit, robot_since=robot_since, human_on=human_on, in_vain=in_vain, at=at)
        self.gaze.spent = self.gaze.spent or human_on
        self.forget_idle(at)

    def robot_directs(self, event: OngoingEvent, clock: LimitClock) -> None:
        there = self._scene.person_looks_at(self.gaze, event.objects)
        robot_on = self._scene.robot_looks_at(event.objects)
        self.facial.directed_gaze_begins(event.started, by_robot=True)
        self.gaze.spent = self.gaze.spent or there
        one = next((one for one in self.directed if set(one.objects) == set(event.objects)), None)
        if one is None:
            one = DirectedGaze(self._writer, event.objects)
            self.directed.append(one)
        one.robot_begins(event, clock, robot_on=robot_on, look=self.gaze if there else None)
        self.forget_idle(event.started)

    def robot_points(self, targets: tuple[str, ...], at: Seconds) -> None:
        for one in self.directed:
            if set(one.objects) & set(targets):
                one.robot_points(at)
        self.forget_idle(at)

    def _expire_directed(self, one: DirectedGaze, at: Seconds) -> None:
        one.expire(at)
        self.forget_idle(at)

    def forget_idle(self, at: Seconds) -> None:
        """Drop finished directed gazes, and remember those of the robot for a while."""
        if self._robot_directed:
            self._robot_directed = [past for past in self._robot_directed if self._is_recent(past, at)]
        for one in [one for one in self.directed if one.state == IDLE]:
            self.directed.remove(one)
            if one.by_robot:
                self._robot_directed.append(_Directed(one.objects, at))

    def waits_for(self, block: str, name: str) -> bool:
        """True if a time limit runs from this sync point of a block of the robot."""
        clocks = [clock for machine in self.gaze_machines() for clock in machine.clocks_of(block)]
        return any(name in clock.waiting for clock in clocks)

    def point_realised(self, block: str, name: str, at: Seconds) -> None:
        """Take a realised sync point of a block of the robot: time limits may run from there."""
        for machine in self.gaze_machines():
            machine.realised(block, name, at)
        self.forget_idle(at)

    def abort(self, at: Seconds, *, turn: str) -> None:
        """Withdraw the events that the robot began in a turn that was cut off."""
        self.talk.take(at, lambda talk: talk.abort(at, turn=turn))
        for machine in self.gaze_machines():
            if turn:
                machine.abort(turn, at)
        self.forget_idle(at)

    def block_ended(self, block: str, at: Seconds, *, aborted: bool) -> None:
        for machine in self.gaze_machines():
            machine.block_ended(block, at, aborted=aborted)
        self.forget_idle(at)
        self.talk.take(at, lambda talk: talk.block_ended(block, at, aborted=aborted))

    def withdraw(self, event: OngoingEvent, at: Seconds, *, is_orphan: bool) -> None:
        """Withdraw an event of the robot.

        is_orphan: whoever asked for it is gone. What the robot has said until the end of its turn is answered all the
        same, so that such a pair stays.
        """
        if event.kind == "adjacency_pair":
            self.talk.take(at, lambda talk: talk.withdraw(event, at, is_orphan=is_orphan))
            return
        for machine in self.gaze_machines():
            machine.withdraw(event, at)
        self.forget_idle(at)

    def _is_recent(self, past: _Directed, at: Seconds) -> bool:
        return in_time(at, past.at + AFTER_ROBOT_DIRECTED)

    # -- mutual facial gaze -------------------------------------------------------------------------------------

    def robot_looks_at_face(self, event: OngoingEvent, clock: LimitClock) -> None:
        robot_on = self._scene.robot_looks_at((self.id,))
        self.facial.robot_begins(event, clock, robot_on=robot_on, look=self.gaze if self.on_robots_face else None)

    # -- new events ---------------------------------------------------------------------------------------------

    def _by_human(
        self, kind: EventKind, at: Seconds, limit: Seconds, confidence: Probability, objects: tuple[str, ...] = ()
    ) -> OngoingEvent:
        return OngoingEvent(
            kind=kind, initiator=self.id, responder=self._scene.robot, started=at, limit=limit, objects=objects,
            confidence=confidence,
        )  # fmt: skip
