"""A scripted person: rules say on which words and motions of the robot the person looks, reaches and moves pieces.

Pure state machine: `feed` takes messages about the robot, `due` returns the acts that are due by now, `deadline` says
when to ask next. Rules belong to steps, which are known from the ids of the robot's fragments (`step-3`, `step-20-a`,
`step-5-fix`). Triggers are things that a person could hear or see: words, looks and points come as they are realised,
so that the order of events is the same on a slow machine. The robot's words are heard word by word (`Hearing`), and
a person's are told as perception tells them (`SpokenWords`).
"""

import re
from collections.abc import Callable, Iterable, Iterator
from heapq import heappop, heappush
from itertools import count

from msgspec import Struct
from msgspec.structs import replace

from engage_hri.schemas.behaviors import Action, EventKind
from engage_hri.schemas.blocks import BlockProgress
from engage_hri.schemas.body import WordSpoken
from engage_hri.schemas.body_faults import BodyFaults
from engage_hri.schemas.messages import Message
from engage_hri.schemas.perception import ActionBegan, ActionEnded, Utterance
from engage_hri.schemas.recognition import ConnectionEvent, EventState
from engage_hri.schemas.tables import Side
from engage_hri.schemas.units import Seconds, Stamp
from engage_hri.services.client.people.actions import RECOGNIZING, Utterances, speaking_time

FACE = "@robot"
"""Placeholder for the robot's face, because the script does not know its id."""
AWAY = ""
TABLE = "table"


# -- acts of the person ---------------------------------------------------------------------------------------


class LookAt(Struct, frozen=True):
    """Look at `target`: an entity, `FACE`, or `AWAY`.

    pointed: true if the robot points at it: then at what its arm is really on.
    """

    target: str
    pointed: bool = False


class Sit(Struct, frozen=True):
    """Come to the table: perception finds the person."""


class Leave(Struct, frozen=True):
    """Go: perception loses the person."""


class Grab(Struct, frozen=True):
    """Reach for a piece, for as long as the hand needs."""

    piece: str


class Lay(Struct, frozen=True):
    """Move a piece to where it touches `side` of `landmark`.

    fits: time for which it is turned to and fro there, beyond that of the way.
    """

    piece: str
    side: Side
    landmark: str
    fits: Seconds = 0.0


class Withdraw(Struct, frozen=True):
    """Take the hands back to the lap, while the script goes on."""


class Pause(Struct, frozen=True):
    """Wait before the next act."""

    seconds: Seconds


class Start(Struct, frozen=True):
    """Begin to speak, nod, shake the head, or point at `target`. words, to: of speech, and to whom, if told."""

    action: Action
    target: str = ""
    words: str = ""
    to: tuple[str, ...] = ()


class Stop(Struct, frozen=True):
    """End the action that the same `Start` began."""

    action: Action
    target: str = ""


class Understood(Struct, frozen=True):
    """A recognizer knows for good what the person said last."""


Act = LookAt | Sit | Leave | Grab | Lay | Withdraw | Pause | Start | Stop | Understood


# -- triggers of acts --------------------------------------------------------------------------------------------


class Entrance(Struct, frozen=True):
    """The person comes in."""


class Begun(Struct, frozen=True):
    """The robot's fragment of this step has begun."""


class Ended(Struct, frozen=True):
    """The robot's fragment of this step has ended."""


class Word(Struct, frozen=True):
    """The robot has said a word (case and punctuation aside) for the nth time in this fragment."""

    text: str
    nth: int = 1


class RobotDoes(Struct, frozen=True):
    """The robot is seen to look or point at something during this step."""

    action: Action
    target: str


class EventChanged(Struct, frozen=True):
    """A connection event about `target` that the robot initiated in this step came to `state`."""

    kind: EventKind
    state: EventState
    target: str = ""


Trigger = Entrance | Begun | Ended | Word | RobotDoes | EventChanged


class Rule(Struct, frozen=True):
    """A rule: in fragment `step`, `delay` seconds after `when`, do the acts one after the other. It fires once."""

    step: str
    when: Trigger
    do: tuple[Act, ...]
    delay: Seconds = 0.0


class _Due(Struct, order=True):
    """Acts to do, one after the other, from `at` on."""

    at: Seconds
    number: int
    acts: tuple[Act, ...]


class Human:
    """The person. vary: returns a number to add to the next reaction time, so that no two are alike."""

    def __init__(
        self, rules: Iterable[Rule], robot: str = "robot", vary: Callable[[], Seconds] = lambda: 0.0
    ) -> None:
        self._rules = tuple(rules)
        self._robot = robot
        self._vary = vary
        self._step = ""
        self._heard: dict[tuple[str, str], int] = {}
        self._fired: set[int] = set()
        self._due: list[_Due] = []
        self._numbers = count()

    @property
    def deadline(self) -> Seconds | None:
        return self._due[0].at if self._due else None

    def enter(self, now: Seconds) -> None:
        """Let the person come in: step 1 begins."""
        self._step = "step-1"
        self._observe("step-1", Entrance(), now)

    def feed(self, message: Message, now: Seconds) -> None:
        """Take a message of the bus; those that say nothing of the robot are ignored."""
        match message:
            case BlockProgress(block=str(block), progress="start") if block.startswith("step-"):
                self._step = block
                self._observe(block, Begun(), now)
            case BlockProgress(block=str(block), progress="end"):
                self._observe(block, Ended(), now)
            case WordSpoken(block=block, word=word):
                for text in re.findall(r"[a-z']+", word.lower()):
                    nth = self._heard[block, text] = self._heard.get((block, text), 0) + 1
                    self._observe(block, Word(text, nth), now)
            case ActionBegan(actor=self._robot, action=action, targets=(target,)):
                self._observe(self._step, RobotDoes(action, target), now)
            case ConnectionEvent(initiator=self._robot, block=block, kind=kind, state=state, objects=objects):
                self._observe(block, EventChanged(kind, state, objects[0] if objects else ""), now)

    def _observe(self, step: str, seen: Trigger, now: Seconds) -> None:
        for index, rule in enumerate(self._rules):
            if index not in self._fired and rule.when == seen and rule.step == step:
                self._fired.add(index)
                self.schedule(rule.do, max(now, now + rule.delay + self._vary()))

    def due(self, now: Seconds) -> tuple[Act, ...]:
        """Return the next due acts: the first is to be done now, the others after it. Empty if nothing is due."""
        if self._due and self._due[0].at <= now:
            return heappop(self._due).acts
        return ()

    def schedule(self, acts: tuple[Act, ...], at: Seconds) -> None:
        """Plan to do the acts from `at` on."""
        if acts:
            heappush(self._due, _Due(at, next(self._numbers), acts))


# -- speech -------------------------------------------------------------------------------------------------------


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
