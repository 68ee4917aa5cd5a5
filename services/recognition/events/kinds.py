"""Kinds of connection events: what the recognizer of a kind is told, and where it is found.

Kinds that depend on each other have one recognizer: `Gazes` for both of gaze, `Talk` for pairs and backchannels. Any
other kind has its own, the `RECOGNIZER` of a module called like the kind, and is found by that name.
"""

from importlib import import_module
from math import inf

from engage_hri.schemas.behaviors import Action, Event, EventKind
from engage_hri.schemas.perception import ActionBegan
from engage_hri.schemas.units import Seconds
from engage_hri.services.recognition.config import RecognitionConfig
from engage_hri.services.recognition.events.limits import LimitClock
from engage_hri.services.recognition.events.machine import EventWriter, OngoingEvent
from engage_hri.services.recognition.events.scene import SessionScene


class KindRecognizer:
    """Recognizer of the events of one kind, or of several, between one person (`id`) and the robot.

    What a kind does not care for it leaves as it is here: without effect.
    """

    def __init__(self, id: str, scene: SessionScene, config: RecognitionConfig, writer: EventWriter) -> None:
        self.id = id
        self._scene = scene
        self._config = config
        self._writer = writer

    def outlook(self) -> tuple[Seconds, bool]:
        """Time of the next step that is due by itself, infinite if there is none; and whether the two are in contact.

        They are while the person and the robot share something. It is asked after each step that may change either.
        """
        return inf, False

    def pass_time(self, at: Seconds) -> None:
        """Take the first step that is due at `at`, as the `outlook` says."""

    @property
    def is_under_way(self) -> bool:
        """True if anything goes on that the robot's deeds may change."""
        return False

    # -- what the person and the robot do -----------------------------------------------------------------------

    def begins(self, began: ActionBegan, at: Seconds, face: str) -> None:
        """Take what the person begins to do; not a look. face: whose face the person looks at; "": nobody's."""

    def stops(self, action: Action, at: Seconds) -> None:
        """Take the end of what the person does; not of a look."""

    def robot_begins(self, began: ActionBegan, at: Seconds) -> None:
        """Take what the robot begins to do; not a look."""

    def robot_stops(self, action: Action, at: Seconds) -> None:
        """Take the end of what the robot does; not of a look."""

    def person_gone(self, at: Seconds, until: Seconds) -> None:
        """Close all open events. until: time at which the person was last seen."""

    # -- what the robot asks for --------------------------------------------------------------------------------

    def limit(self, wanted: Event) -> Seconds | None:
        """Time that the person has if the robot's request does not say; None: nobody has to respond."""
        return None

    def robot_asks(self, event: OngoingEvent, clock: LimitClock | None, ended: Seconds | None) -> None:
        """Begin an event that the robot has asked for.

        clock: of its limit. ended: when the turn of a pair, or else the block, was over, if it was before this.
        """

    def point_realised(self, block: str, name: str, at: Seconds) -> None:
        """Take a realised sync point of a block of the robot: time limits may run from there."""

    def withdraw(self, event: OngoingEvent, at: Seconds, *, is_orphan: bool) -> None:
        """Withdraw an event of the robot. is_orphan: whoever asked for it is gone."""

    def abort(self, at: Seconds, *, turn: str) -> None:
        """End the events that the robot began in a turn that was cut off."""

    def block_ended(self, block: str, at: Seconds, *, aborted: bool) -> None:
        """Take the end of a block of the robot."""


def own_recognizer(kind: EventKind) -> type[KindRecognizer]:
    """Find the recognizer of a kind that stands alone, by the kind's name."""
    found: type[KindRecognizer] = import_module(f"engage_hri.services.recognition.events.{kind}").RECOGNIZER
    return found
