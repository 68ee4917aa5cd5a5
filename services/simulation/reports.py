"""What perception tells of a person: what they do, or only their head and voice.

Pure. Both are fed with what really happens, as exact messages, and with frames of camera and microphone.
"""

import math
from collections.abc import Iterator
from typing import Protocol

from msgspec.structs import replace

from engage_hri.schemas.actions import ActionBegan, ActionEnded, ActorFound, ActorLost
from engage_hri.schemas.messages import Message
from engage_hri.schemas.perception import HeadPose, VoiceActivity
from engage_hri.schemas.units import Seconds, Stamp
from engage_hri.services.simulation.config import PerceptionFaults
from engage_hri.services.simulation.faults import Chances, off_by
from engage_hri.services.simulation.head import Sightlines, SimulatedHead


class Reports(Protocol):
    """One person, as perceived."""

    def happened(self, message: Message, now: Seconds) -> Iterator[Message]:
        """The person did something."""

    def seen(self, lost: bool, at: Stamp, now: Seconds) -> Iterator[Message]:
        """A frame of the camera. lost: it does not find the face."""

    def heard(self, at: Stamp, now: Seconds) -> Iterator[Message]:
        """A frame of the microphone."""


class Ear:
    """Which utterances are heard. heard: one is, now."""

    def __init__(self, faults: PerceptionFaults, chances: Chances) -> None:
        self._dropped = faults.dropped_speech
        self._chance = chances("speech")
        self.heard = False

    def hear(self, message: ActionBegan | ActionEnded) -> bool:
        """An utterance begins or ends. Is it heard?"""
        if isinstance(message, ActionBegan):
            self.heard = self._chance.random() >= self._dropped
            return self.heard
        was, self.heard = self.heard, False
        return was


class Actions:
    """`symbolic`: looks, speech and manipulations are told as such. Looks may go wrong or unnoticed."""

    def __init__(self, sightlines: Sightlines, faults: PerceptionFaults, chances: Chances) -> None:
        self._sightlines = sightlines
        self._faults = faults
        self._chance = chances("looks")
        self._ear = Ear(faults, chances)
        self._look: ActionBegan | None = None
        """As it seems to go. None: nobody has noticed one."""
        self._told: ActionBegan | None = None
        self._lost = False

    def happened(self, message: Message, now: Seconds) -> Iterator[Message]:
        match message:
            case ActionBegan(action="look"):
                self._look = self._noticed(message, now)
                if self._look is not None and not self._lost:
                    self._told = self._look
                    yield self._told
            case ActionEnded(action="look"):
                self._look = None
                if self._told is not None and not self._lost:
                    yield replace(message, targets=self._told.targets)
                    self._told = None
            case ActorLost() if self._lost:
                self._lost, self._told = False, None  # said already
            case (ActionBegan(action="speak") | ActionEnded(action="speak")) as speech:
                if self._ear.hear(speech):
                    yield speech
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
        if self._told is self._look:
            return
        if self._told is not None:
            yield ActionEnded(actor=actor, action="look", targets=self._told.targets, at=at)
        if self._look is not None:
            yield replace(self._look, at=at)
        self._told = self._look

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


class Signals:
    """`raw`: the head's pose and the voice. Manipulations show in the world; nods and points are told as such."""

    def __init__(
        self, sightlines: Sightlines, faults: PerceptionFaults, chances: Chances, *, head_turn: Seconds
    ) -> None:
        self._sightlines = sightlines
        self._deviation = math.radians(faults.gaze)
        self._chance = chances("gaze")
        self._ear = Ear(faults, chances)
        self._head = SimulatedHead(head_turn)
        self._target = ""

    def happened(self, message: Message, now: Seconds) -> Iterator[Message]:
        match message:
            case ActionBegan(action="look", targets=targets):
                self._head.turn(self._facing(now), now)
                self._target = targets[0] if targets else ""
            case (ActionBegan(action="speak") | ActionEnded(action="speak")) as speech:
                self._ear.hear(speech)
            case ActionBegan(action="nod" | "shake" | "point") | ActionEnded(action="nod" | "shake" | "point"):
                yield message

    def seen(self, lost: bool, at: Stamp, now: Seconds) -> Iterator[Message]:
        if not lost:
            facing = off_by(self._facing(now), self._deviation, self._chance)
            yield HeadPose(actor=self._sightlines.person, position=self._sightlines.eyes, direction=facing, at=at)

    def heard(self, at: Stamp, now: Seconds) -> Iterator[Message]:
        yield VoiceActivity(actor=self._sightlines.person, active=self._ear.heard, at=at)

    def _facing(self, now: Seconds) -> tuple[float, float, float]:
        return self._head.facing(self._sightlines.to(self._target, now), now)
