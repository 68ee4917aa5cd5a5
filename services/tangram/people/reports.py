"""Reports of perception about a person: actions, or only head and voice.

Pure. Both kinds take exact messages of what really happens, and frames of camera and microphone.
"""

import math
from collections.abc import Iterator
from typing import Protocol

from msgspec.structs import replace

from engage_hri.schemas.messages import Message
from engage_hri.schemas.perception import (
    ActionBegan,
    ActionEnded,
    ActorFound,
    ActorLost,
    HeadPose,
    Utterance,
    VoiceActivity,
)
from engage_hri.schemas.units import Seconds, Stamp
from engage_hri.services.tangram.people.config import PerceptionFaults
from engage_hri.services.tangram.people.faults import Chances, deviated
from engage_hri.services.tangram.people.head import Sightlines, SimulatedHead

HEAD_TURN: Seconds = 0.2
"""Time that the person's head takes to face another target. Ours."""


class Reports(Protocol):
    """Perception of one person."""

    def happened(self, message: Message, now: Seconds) -> Iterator[Message]:
        """Take an exact message of what the person did."""

    def seen(self, lost: bool, at: Stamp, now: Seconds) -> Iterator[Message]:
        """Take a frame of the camera. lost: it does not find the face."""

    def heard(self, at: Stamp, now: Seconds) -> Iterator[Message]:
        """Take a frame of the microphone."""


class Ear:
    """Hearing of utterances, some of which are missed.

    heard: True while one is heard. understood: the last one was heard, so its words are known.
    announced: the words of the next one will come, if that is heard.
    """

    def __init__(self, faults: PerceptionFaults, chances: Chances) -> None:
        self._dropped = faults.dropped_speech
        self._chance = chances("speech")
        self.heard = self.understood = False
        self.announced: Utterance | None = None

    def hear(self, message: ActionBegan | ActionEnded) -> Iterator[Message]:
        """Take the beginning or end of speech. Yields it if it is heard, behind the news that words will come."""
        announced, self.announced = self.announced, None
        if isinstance(message, ActionBegan):
            self.heard = self.understood = self._chance.random() >= self._dropped
            if self.heard and announced is not None:
                yield announced
            is_heard = self.heard
        else:
            is_heard, self.heard = self.heard, False
        if is_heard:
            yield message

    def understand(self, message: Utterance) -> Iterator[Message]:
        """Take words. Yields them if they were heard."""
        if not message.final:
            self.announced = message
        elif self.understood:
            yield message


class SymbolicReports:
    """Reports for `symbolic`: looks, speech and manipulations as such. Looks may be wrong or missed."""

    def __init__(self, sightlines: Sightlines, faults: PerceptionFaults, chances: Chances) -> None:
        self._sightlines = sightlines
        self._faults = faults
        self._chance = chances("looks")
        self._ear = Ear(faults, chances)
        self._look: ActionBegan | None = None
        """Present look as perceived; None if there is none, or it is missed."""
        self._reported: ActionBegan | None = None
        """Look that was reported last and not ended."""
        self._lost = False

    def happened(self, message: Message, now: Seconds) -> Iterator[Message]:
        match message:
            case ActionBegan(action="look"):
                self._look = self._noticed(message, now)
                if self._look is not None and not self._lost:
                    self._reported = self._look
                    yield self._reported
            case ActionEnded(action="look"):
                self._look = None
                if self._reported is not None and not self._lost:
                    yield replace(message, targets=self._reported.targets)
                    self._reported = None
            case ActorLost(at=at) if self._lost:
                if self._reported is not None:
                    yield ActionEnded(actor=message.actor, action="look", targets=self._reported.targets, at=at)
                self._lost, self._reported = False, None  # the loss was reported when the face was lost
            case (ActionBegan(action="speak") | ActionEnded(action="speak")) as speech:
                yield from self._ear.hear(speech)
            case Utterance():
                yield from self._ear.understand(message)
            case _:
                yield message

    def seen(self, lost: bool, at: Stamp, now: Seconds) -> Iterator[Message]:
        if lost == self._lost:
            return
        self._lost = lost
        actor = self._sightlines.person
        if lost:
            yield ActorLost(actor=actor, at=at)
            return
        yield ActorFound(actor=actor, at=at)
        if self._reported is self._look:
            return
        if self._reported is not None:
            yield ActionEnded(actor=actor, action="look", targets=self._reported.targets, at=at)
        if self._look is not None:
            yield replace(self._look, at=at)
        self._reported = self._look

    def heard(self, at: Stamp, now: Seconds) -> Iterator[Message]:
        yield from ()

    def _noticed(self, look: ActionBegan, now: Seconds) -> ActionBegan | None:
        missed = self._chance.random() < self._faults.missed_look
        wrong = self._chance.random() < self._faults.wrong_look
        if missed:
            return None
        if wrong and look.targets:
            return replace(look, targets=(self._sightlines.beside(look.targets[0], now),))
        return look


class RawReports:
    """Reports for `raw`: the head's pose and the voice. Manipulations show in the world; nods and points as such."""

    def __init__(self, sightlines: Sightlines, faults: PerceptionFaults, chances: Chances) -> None:
        self._sightlines = sightlines
        self._deviation = math.radians(faults.gaze)
        self._chance = chances("gaze")
        self._ear = Ear(faults, chances)
        self._head = SimulatedHead(HEAD_TURN)
        self._target = ""

    def happened(self, message: Message, now: Seconds) -> Iterator[Message]:
        match message:
            case ActionBegan(action="look", targets=targets):
                self._head.turn(self._facing(now), now)
                self._target = targets[0] if targets else ""
            case (ActionBegan(action="speak") | ActionEnded(action="speak")) as speech:
                yield from (told for told in self._ear.hear(speech) if isinstance(told, Utterance))
            case Utterance():
                yield from self._ear.understand(message)
            case ActionBegan(action="nod" | "shake" | "point") | ActionEnded(action="nod" | "shake" | "point"):
                yield message

    def seen(self, lost: bool, at: Stamp, now: Seconds) -> Iterator[Message]:
        if not lost:
            facing = deviated(self._facing(now), self._deviation, self._chance)
            yield HeadPose(actor=self._sightlines.person, position=self._sightlines.eyes, direction=facing, at=at)

    def heard(self, at: Stamp, now: Seconds) -> Iterator[Message]:
        yield VoiceActivity(actor=self._sightlines.person, active=self._ear.heard, at=at)

    def _facing(self, now: Seconds) -> tuple[float, float, float]:
        return self._head.facing(self._sightlines.to(self._target, now), now)
