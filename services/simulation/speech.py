"""Speech between robot and simulated person: its words as a person hears them, a person's as they are told."""

import re
from collections.abc import Iterator

from msgspec import Struct
from msgspec.structs import replace

from engage_hri.schemas.blocks import BlockProgress
from engage_hri.schemas.body import WordSpoken
from engage_hri.schemas.body_faults import BodyFaults
from engage_hri.schemas.messages import Message
from engage_hri.schemas.perception import ActionBegan, ActionEnded, Utterance
from engage_hri.schemas.units import Seconds, Stamp
from engage_hri.services.client.people.actions import RECOGNIZING, Utterances, speaking_time
from engage_hri.services.simulation.human import Act, Pause, Start, Stop, Understood


def speech(words: str, seconds: Seconds | None = None, to: tuple[str, ...] = ()) -> tuple[Act, ...]:
    """Acts of saying these words. seconds: that it takes; None: as long as such words do. to: whom, if that is told.

    Without words it is a laugh.
    """
    seconds = speaking_time(words) if seconds is None else seconds
    voice = (Start("speak", words=words, to=to), Pause(seconds), Stop("speak"))
    return (*voice, Pause(RECOGNIZING), Understood()) if words else voice


class SpokenWords:
    """The words of one person. life: of the program that simulates it."""

    def __init__(self, person: str, life: str) -> None:
        self._utterances = Utterances(person, life)
        self._said: list[Utterance] = []
        """Those whose words are not known for good yet. Who goes on at once has two."""

    def does(self, act: Act, at: Stamp) -> Iterator[Utterance]:
        """Take an act; only those that concern speech count."""
        match act:
            case Start(action="speak", words=words, to=to) if words:
                self._said.append(replace(self._utterances.begun(at, to), text=words))
                yield replace(self._said[-1], text="")
            case Stop(action="speak") if self._said and self._said[-1].ended is None:
                self._said[-1] = replace(self._said[-1], ended=at)
            case Understood() if self._said:
                yield replace(self._said.pop(0), at=at, final=True)


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
