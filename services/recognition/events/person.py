"""One person and the robot: what each does becomes input of the recognizers of all kinds of events between them."""

from collections.abc import Callable
from math import inf
from operator import attrgetter
from typing import Literal, NamedTuple

from engage_hri.schemas.behaviors import EVENT_KINDS, Action, EventKind
from engage_hri.schemas.perception import ActionBegan, ActionEnded
from engage_hri.schemas.units import Probability, Seconds
from engage_hri.services.recognition.config import RecognitionConfig
from engage_hri.services.recognition.events.gazes import Gazes
from engage_hri.services.recognition.events.history import ActionHistory
from engage_hri.services.recognition.events.kinds import KindRecognizer, own_recognizer
from engage_hri.services.recognition.events.machine import EventWriter
from engage_hri.services.recognition.events.presence import FacePresence
from engage_hri.services.recognition.events.scene import SessionScene
from engage_hri.services.recognition.events.talk import Talk

LONGEST: dict[Action, Seconds] = {"speak": 60.0, "act": 120.0}
"""Time after which speech or a manipulation is over if no report of its end has come; the next ends it, too. Ours."""
LONGEST_GESTURE: Seconds = 10.0
"""The same for a nod, a shake, a point, and any other action. Ours."""
ACTIONS_KEPT = 64
"""Number of actions of each person for which it is remembered when they last began and ended."""


Part = Literal["all", "looks", "rest"]
"""What of a person a step may change: all, the look and the gaze events, or the rest; presence with any of these.
Most of what people do is looking about, and concerns nothing else."""
_is_under_way, _until = attrgetter("is_under_way"), attrgetter("until")


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
        self.gazes = Gazes(id, scene, config, writer)
        self.talk = Talk(id, scene, config, writer)
        shared: dict[EventKind, KindRecognizer] = {
            "directed_gaze": self.gazes, "mutual_facial_gaze": self.gazes,
            "adjacency_pair": self.talk, "backchannel": self.talk,
        }  # fmt: skip
        self._by_kind = {
            kind: shared.get(kind) or own_recognizer(kind)(id, scene, config, writer) for kind in EVENT_KINDS
        }
        self._recognizers = tuple(dict.fromkeys(self._by_kind.values()))
        self._rest = tuple(each for each in self._recognizers if each is not self.gazes)
        """Recognizers of which looks are no part."""
        self.history = ActionHistory(ACTIONS_KEPT)
        self._doing: dict[Action, _Doing] = {}
        """Present actions other than looking."""
        self.due: Seconds = inf
        """Time of the next step that is due by itself, unless an input comes before; then call `pass_time`."""
        self.contact: Probability | None = None
        """Contact with the robot now, from 0 to 1; None: nobody has told where the person looks."""
        self._looks_due = self._rest_due = inf
        self._looks_touch = self._rest_touches = False
        """True if the person is in contact with the robot by looks, or by all the rest."""
        self._scene = scene

    # -- time ---------------------------------------------------------------------------------------------------

    def settle(self, part: Part) -> None:
        """Bring `due` and `contact` up to date after a step that may have changed this part of the person."""
        gaze = self.gazes.gaze
        if part != "rest":
            due, self._looks_touch = self.gazes.outlook()
            if gaze.targets:
                due = min(due, self.gazes.look_directs_at() if gaze.ended == inf else gaze.deadline)
            self._looks_due = due
        if part != "looks":
            due = min(map(_until, self._doing.values())) if self._doing else inf
            self._rest_touches = False
            for each in self._rest:
                one, touches = each.outlook()
                if one < due:
                    due = one
                if touches:
                    self._rest_touches = True
            self._rest_due = due
        self.due = min(self.presence.deadline, self._looks_due, self._rest_due)
        if self.presence.here and (self._looks_touch or self._rest_touches):
            self.contact = 1.0
        else:
            self.contact = None if gaze.since == 0.0 and not gaze.targets else 0.0

    @property
    def is_involved(self) -> bool:
        """True if anything goes on between the person and the robot that the robot's deeds may change."""
        return any(map(_is_under_way, self._recognizers))

    def pass_time(self, at: Seconds) -> None:
        """Take the first step that is due at `at`. There is none if something that all share has put it off."""
        if self.gazes.gaze.deadline == at:
            self.gaze_changed(self.gazes.gaze.expire())
        elif self.presence.deadline == at:
            self.leave(at)
        elif (due := next((each for each in self._recognizers if each.outlook()[0] == at), None)) is not None:
            due.pass_time(at)
        elif self.gazes.look_directs_at() == at:
            self.gazes.look_directs(at)
        else:
            self._end_overlong(at)

    def leave(self, at: Seconds) -> None:
        """Count the person as gone, and close all its open events."""
        until = self.presence.leave()
        for each in self._recognizers:
            each.person_gone(at, until)
        self._doing.clear()
        self._scene.stops(self.id, until)

    # -- what the person does -----------------------------------------------------------------------------------

    def begins(self, began: ActionBegan, at: Seconds) -> None:
        if not self.history.is_new(began, at) or not self.presence.seen(at):
            return
        action = began.action
        if action == "look":
            was_on_face = self.gazes.on_robots_face
            if self.gazes.gaze.begin(began.targets, at, began.confidence, one_of=began.one_of):
                self.gaze_changed(at)
                if not was_on_face:
                    self.gazes.seeks_face(at)
            return
        if action in self._doing:
            if at < self._doing[action].since:
                return
            self._stops(action, at)  # its end has been lost
        self._note(began, at, at)
        for each in self._recognizers:
            each.begins(began, at, self.gazes.face)

    def _note(self, began: ActionBegan, since: Seconds, at: Seconds) -> None:
        """Note an action of the person that goes on. at: time from which on its end is waited for."""
        action = began.action
        self._doing[action] = _Doing(began.targets, since, at + LONGEST.get(action, LONGEST_GESTURE))
        if action == "speak":
            self._scene.speaks(self.id)
        elif action == "act":
            self._scene.acting.add(self.id)

    def goes_on(self, began: ActionBegan, since: Seconds, at: Seconds) -> None:
        """Take an action that goes on, known only now: it answers what waits for it, and begins nothing itself."""
        if not self.presence.seen(at):
            return
        self.history.is_new(began, since)  # its beginning is no news any more
        action, targets = began.action, began.targets
        if action == "look":
            if self.gazes.gaze.targets and since < self.gazes.gaze.since:
                return  # there is a newer one
            since = max(since, self.gazes.gaze.since)
            if self.gazes.gaze.begin(targets, since, began.confidence, one_of=began.one_of):
                self.gazes.gaze.spent = True
                self.gaze_changed(since)
        elif action not in self._doing:
            self._note(began, since, at)
            self.talk.goes_on(action, since, at, began.confidence, self.gazes.face)

    def ends(self, ended: ActionEnded, at: Seconds) -> None:
        if not self.history.is_new(ended, at):
            return
        if ended.action == "look":
            self.gazes.gaze.end(ended.targets, at)
            return
        doing = self._doing.get(ended.action)
        if doing is not None and at >= doing.since and (not ended.targets or ended.targets == doing.targets):
            self._stops(ended.action, at)

    def _stops(self, action: Action, at: Seconds) -> None:
        del self._doing[action]
        if action == "speak":
            self._scene.falls_silent(self.id, at)
        elif action == "act":
            self._scene.acting.discard(self.id)
        for each in self._recognizers:
            each.stops(action, at)

    def _end_overlong(self, at: Seconds) -> None:
        """End actions with a lost end and no later beginning."""
        for action in [action for action, one in self._doing.items() if one.until <= at]:
            self._stops(action, at)

    def gaze_changed(self, at: Seconds) -> None:
        """Take a change of the person's gaze."""
        self.talk.looks_at(self.gazes.face, at)
        self.gazes.gaze_changed(at)

    # -- the robot ----------------------------------------------------------------------------------------------

    def tell(self, step: Callable[[KindRecognizer], None]) -> None:
        """Tell all recognizers what the robot does."""
        for each in self._recognizers:
            step(each)

    def recognizer(self, kind: EventKind) -> KindRecognizer:
        """Recognizer of the events of this kind."""
        return self._by_kind[kind]

    def abort(self, at: Seconds, *, turn: str) -> None:
        """End the events that the robot began in a turn that was cut off: what was said, then what was shown."""
        for each in reversed(self._recognizers):
            each.abort(at, turn=turn)
