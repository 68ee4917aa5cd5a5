"""Gaze of one person and the robot: directed gaze, at each set of objects by itself, and mutual facial gaze."""

from math import inf
from typing import NamedTuple

from engage_hri.schemas.behaviors import Action, Event, EventKind
from engage_hri.schemas.perception import ActionBegan
from engage_hri.schemas.units import Probability, Seconds
from engage_hri.services.recognition.config import RecognitionConfig
from engage_hri.services.recognition.events.directed_gaze import HUMAN_DIRECTING, DirectedGaze
from engage_hri.services.recognition.events.kinds import KindRecognizer
from engage_hri.services.recognition.events.limits import LimitClock, in_time
from engage_hri.services.recognition.events.machine import IDLE, EventWriter, OngoingEvent
from engage_hri.services.recognition.events.mutual_facial_gaze import HUMAN_WAITING, MutualFacialGaze
from engage_hri.services.recognition.events.scene import GazeState, SessionScene
from engage_hri.services.recognition.events.shared_gaze import SharedGaze

DIRECT_BY_LOOK: Seconds = 0.6
"""Time for which a person looks at an object before that directs the robot's gaze: a shorter look takes in the scene.
Less than the time for which an absent person is remembered. Ours."""
AFTER_ROBOT_DIRECTED: Seconds = 2.0
"""Time after a robot's directed gaze in which a look at the same object is no direction of its own, but a late
response. Less than the time for which an absent person is remembered. Ours."""


class _Directed(NamedTuple):
    """A directed gaze of the robot that is over."""

    objects: tuple[str, ...]
    at: Seconds


class Gazes(KindRecognizer):
    """The look of a person, and the gaze events with the robot that come of it."""

    def __init__(self, id: str, scene: SessionScene, config: RecognitionConfig, writer: EventWriter) -> None:
        super().__init__(id, scene, config, writer)
        self.gaze = GazeState()
        self.facial = MutualFacialGaze(writer)
        self.directed: list[DirectedGaze] = []
        self._robot_directed: list[_Directed] = []

    def outlook(self) -> tuple[Seconds, bool]:
        due, in_contact = inf, self._scene.robot in self.gaze.targets
        for machine in self._machines() if self.directed else (self.facial,):
            if machine.event is not None:
                due, in_contact = min(machine.deadline, due), in_contact or machine.is_shared
        return due, in_contact

    def pass_time(self, at: Seconds) -> None:
        one = next((one for one in self.directed if one.deadline == at), None)
        if one is None:
            self.facial.expire(at)
        else:
            one.expire(at)
            self._forget_idle(at)

    @property
    def is_under_way(self) -> bool:
        """True if a gaze event goes on, or the robot has just directed the person's gaze."""
        return self.facial.event is not None or bool(self.directed or self._robot_directed)

    def look_directs_at(self) -> Seconds:
        """Time at which the person's look has lasted long enough to direct the robot's; infinite if it does not."""
        gaze = self.gaze
        if not gaze.targets or gaze.spent or gaze.ended < inf or self.id in self._scene.acting:
            return inf
        if not any(map(self._scene.is_object, gaze.targets)):
            return inf
        return max(gaze.since, self._scene.others_silent_since(self.id)) + DIRECT_BY_LOOK

    def person_gone(self, at: Seconds, until: Seconds) -> None:
        for one in self.directed:
            one.person_gone(at, until)
        self._forget_idle(at)
        self.facial.person_gone(at, until)
        self.gaze = GazeState(since=until)

    def begins(self, began: ActionBegan, at: Seconds, face: str) -> None:
        if began.action == "point" and (objects := tuple(filter(self._scene.is_object, began.targets))):
            self._human_directs(objects, at, at, began.confidence)

    def stops(self, action: Action, at: Seconds) -> None:
        """Mark a look that goes with a manipulation: it directs nothing."""
        if action == "act":
            self.gaze.spent = True

    # -- looks --------------------------------------------------------------------------------------------------

    @property
    def on_robots_face(self) -> bool:
        return self._scene.robot in self.gaze.targets

    @property
    def face(self) -> str:
        """Actor whose face the person looks at; "": none, or one of several."""
        faces = [*filter(self._scene.is_face, self.gaze.targets)]
        return faces[0] if faces and not (self.gaze.one_of and len(faces) > 1) else ""

    def gaze_changed(self, at: Seconds) -> None:
        if self.is_under_way:
            self._goes_on(at)
        self.hands_changed()

    def _goes_on(self, at: Seconds) -> None:
        """Tell the events under way where both look now."""
        sureness = self.gaze.sureness
        if self.facial.event is not None:
            robot_on, confidence = self._scene.robot_looks_at((self.id,)), sureness((self._scene.robot,))
            self.facial.gazes(robot_on=robot_on, human_on=self.on_robots_face, at=at, confidence=confidence)
        for one in self.directed:
            human_on = self._scene.person_looks_at(self.gaze, one.objects)
            if human_on and one.event is not None and one.event.cause != "human":
                self.gaze.spent = True
            robot_on = self._scene.robot_looks_at(one.objects)
            one.gazes(robot_on=robot_on, human_on=human_on, at=at, confidence=sureness(one.objects))
        self._forget_idle(at)
        for past in self._robot_directed:
            if self._scene.person_looks_at(self.gaze, past.objects) and self._is_recent(past, at):
                self.gaze.spent = True

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
        self._forget_idle(at)

    # -- what the person begins ---------------------------------------------------------------------------------

    def seeks_face(self, at: Seconds) -> None:
        """Begin a mutual facial gaze by the person's look, if none goes on."""
        if not self.on_robots_face or self.facial.state != IDLE:
            return
        limit = self._config.mutual_facial_gaze_limit
        event = self._by_human("mutual_facial_gaze", at, limit, self.gaze.sureness((self._scene.robot,)))
        in_vain, robot_since = self._scene.fragment_looks_elsewhere((self.id,)), self._scene.robot_since((self.id,))
        self.facial.human_begins(event, limit, robot_since=robot_since, human_on=True, in_vain=in_vain, at=at)

    def look_directs(self, at: Seconds) -> None:
        """Begin a directed gaze by a look that has lasted long enough."""
        self.gaze.spent = True
        objects = tuple(filter(self._scene.is_object, self.gaze.targets))
        self._human_directs(objects, at - DIRECT_BY_LOOK, at, self.gaze.sureness(objects), one_of=self.gaze.one_of)

    def _human_directs(
        self, objects: tuple[str, ...], since: Seconds, at: Seconds, confidence: Probability, *, one_of: bool = False
    ) -> None:
        """Begin a directed gaze. since: start of the pointing, or of the look that has become a direction at `at`."""
        if any(set(one.objects) & set(objects) for one in self.directed):
            return
        limit = self._config.directed_gaze_limit
        event = self._by_human("directed_gaze", since, limit, confidence, objects)
        event.one_of = one_of and len(objects) > 1
        in_vain = self._scene.fragment_looks_elsewhere(objects)
        robot_since = self._scene.robot_since(objects)
        if robot_since is not None or not in_vain:
            self.facial.directed_gaze_begins(at, by_robot=False)
        human_on = self._scene.person_looks_at(self.gaze, objects)
        one = DirectedGaze(self._writer, objects)
        self.directed.append(one)
        one.human_begins(event, limit, robot_since=robot_since, human_on=human_on, in_vain=in_vain, at=at)
        self.gaze.spent = self.gaze.spent or human_on
        self._forget_idle(at)

    def _by_human(
        self, kind: EventKind, at: Seconds, limit: Seconds, confidence: Probability, objects: tuple[str, ...] = ()
    ) -> OngoingEvent:
        return OngoingEvent(
            kind=kind, initiator=self.id, responder=self._scene.robot, started=at, limit=limit, objects=objects,
            confidence=confidence,
        )  # fmt: skip

    # -- what the robot begins ----------------------------------------------------------------------------------

    def limit(self, wanted: Event) -> Seconds | None:
        is_directed = wanted.kind == "directed_gaze"
        return self._config.directed_gaze_limit if is_directed else self._config.mutual_facial_gaze_limit

    def robot_asks(self, event: OngoingEvent, clock: LimitClock | None, ended: Seconds | None) -> None:
        assert clock is not None
        if event.kind == "directed_gaze":
            self._robot_directs(event, clock)
        else:
            robot_on, look = self._scene.robot_looks_at((self.id,)), self.gaze if self.on_robots_face else None
            self.facial.robot_begins(event, clock, robot_on=robot_on, look=look)

    def _robot_directs(self, event: OngoingEvent, clock: LimitClock) -> None:
        there = self._scene.person_looks_at(self.gaze, event.objects)
        robot_on = self._scene.robot_looks_at(event.objects)
        self.facial.directed_gaze_begins(event.started, by_robot=True)
        self.gaze.spent = self.gaze.spent or there
        one = next((one for one in self.directed if set(one.objects) == set(event.objects)), None)
        if one is None:
            one = DirectedGaze(self._writer, event.objects)
            self.directed.append(one)
        one.robot_begins(event, clock, robot_on=robot_on, look=self.gaze if there else None)
        self._forget_idle(event.started)

    def robot_begins(self, began: ActionBegan, at: Seconds) -> None:
        if began.action == "point" and self.directed:
            for one in self.directed:
                if set(one.objects) & set(began.targets):
                    one.robot_points(at)
            self._forget_idle(at)

    def point_realised(self, block: str, name: str, at: Seconds) -> None:
        for machine in self._machines():
            machine.realised(block, name, at)
        self._forget_idle(at)

    def withdraw(self, event: OngoingEvent, at: Seconds, *, is_orphan: bool) -> None:
        for machine in self._machines():
            machine.withdraw(event, at)
        self._forget_idle(at)

    def abort(self, at: Seconds, *, turn: str) -> None:
        for machine in self._machines():
            if turn:
                machine.abort(turn, at)
        self._forget_idle(at)

    def block_ended(self, block: str, at: Seconds, *, aborted: bool) -> None:
        for machine in self._machines():
            machine.block_ended(block, at, aborted=aborted)
        self._forget_idle(at)

    def _machines(self) -> list[SharedGaze]:
        return [self.facial, *self.directed]

    # -- directed gazes that are over ---------------------------------------------------------------------------

    def _forget_idle(self, at: Seconds) -> None:
        """Drop finished directed gazes, and remember those of the robot for a while."""
        if self._robot_directed:
            self._robot_directed = [past for past in self._robot_directed if self._is_recent(past, at)]
        for one in [one for one in self.directed if one.state == IDLE]:
            self.directed.remove(one)
            if one.by_robot:
                self._robot_directed.append(_Directed(one.objects, at))

    def _is_recent(self, past: _Directed, at: Seconds) -> bool:
        return in_time(at, past.at + AFTER_ROBOT_DIRECTED)
