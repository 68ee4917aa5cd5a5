"""Hearing of the robot's words: those of a whole block, with the object at which it pointed meanwhile. Pure."""

import re

from msgspec import Struct

from engage_hri.schemas.blocks import BlockProgress
from engage_hri.schemas.body import WordSpoken
from engage_hri.schemas.body_faults import BodyFaults
from engage_hri.schemas.messages import Message
from engage_hri.schemas.perception import ActionBegan, ActionEnded

THINKING = "ummmm"
"""Words of a robot that will go on speaking: they need no answer."""


class HeardSpeech(Struct, frozen=True):
    """Words of a block of the robot, lower case without punctuation, and the object at which it pointed meanwhile."""

    words: str
    pointed: str = ""
    is_question: bool = False


class Ears:
    """Ears for the robot's words: there are none to hear while its voice makes no sound (fault `mute`)."""

    def __init__(self) -> None:
        self._is_mute = False

    def hear(self, message: Message) -> bool:
        """Take a message about the robot. Returns False for a word that nobody can hear."""
        if isinstance(message, BodyFaults):
            self._is_mute = any(fault.kind == "mute" for fault in message.faults)
        return not (self._is_mute and isinstance(message, WordSpoken))


class Hearing:
    """Collector of the robot's words until their block has ended."""

    def __init__(self, robot: str) -> None:
        self._robot = robot
        self._words: dict[str, list[str]] = {}
        self._pointed: dict[str, str] = {}
        self._pointing_at = ""

    def feed(self, message: Message) -> HeardSpeech | None:
        """Take a message about the robot. Returns the utterance that is over now, if one is."""
        match message:
            case WordSpoken(block=block, word=word):
                self._words.setdefault(block, []).append(word)
                if self._pointing_at:
                    self._pointed[block] = self._pointing_at
            case ActionBegan(actor=self._robot, action="point", targets=(target,)):
                self._pointing_at = target
            case ActionEnded(actor=self._robot, action="point"):
                self._pointing_at = ""
            case BlockProgress(block=str(block), progress="end") if block in self._words:
                said = " ".join(self._words.pop(block))
                words = re.sub(r"[^a-z' ]", "", said.lower()).split()
                return HeardSpeech(" ".join(words), self._pointed.pop(block, ""), said.rstrip().endswith("?"))
        return None
