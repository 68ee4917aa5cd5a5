"""A scripted person: rules say on which of the robot's words and motions they look, reach and move pieces.

Pure state machine: `feed` what the bus says of the robot, `due` gives what the person does by now, `deadline` says
when to ask next. Rules belong to steps, steps are known from the ids of the robot's fragments (`step-3`,
`step-20-a`, `step-5-fix`). Triggers are things a person could hear or see; where the robot is concerned the words,
looks and points come as they are realised, so that the order of events is the same on a slow machine.
"""

import re
from collections.abc import Callable, Iterable
from heapq import heappop, heappush

from msgspec import Struct

from engage_hri.schemas.actions import ActionBegan
from engage_hri.schemas.behaviors import Action, EventKind
from engage_hri.schemas.body import WordSpoken
from engage_hri.schemas.feedback import BlockProgress
from engage_hri.schemas.messages import Message
from engage_hri.schemas.recognition import ConnectionEvent, EventState
from engage_hri.schemas.units import Seconds
from engage_hri.services.tangram.table import Side

FACE = "@robot"
"""Stands for the robot's face, whose id the script does not know."""
AWAY = ""
TABLE = "table"


# -- what the person does ---------------------------------------------------------------------------------------


class LookAt(Struct, frozen=True):
    """target: an entity, `FACE`, or `AWAY`."""

    target: str


class Sit(Struct, frozen=True):
    """Come to the table: perception finds them."""


class Leave(Struct, frozen=True):
    """Go: perception loses them."""


class Grab(Struct, frozen=True):
    """Reach for a piece. Takes as long as the hand needs."""

    piece: str


class Lay(Struct, frozen=True):
    """Move a piece to where it touches `side` of `landmark`."""

    piece: str
    side: Side
    landmark: str


class Withdraw(Struct, frozen=True):
    """Hands back to the lap, while the script goes on."""


class Pause(Struct, frozen=True):
    seconds: Seconds


class Start(Struct, frozen=True):
    """Begin to speak, nod, shake the head, or point at `target`."""

    action: Action
    target: str = ""


class Stop(Struct, frozen=True):
    """End what the same `Start` began."""

    action: Action
    target: str = ""


Act = LookAt | Sit | Leave | Grab | Lay | Withdraw | Pause | Start | Stop


# -- when they do it --------------------------------------------------------------------------------------------


class Entrance(Struct, frozen=True):
    """The person comes in."""


class Begun(Struct, frozen=True):
    """The robot's fragment of this step has begun."""


class Ended(Struct, frozen=True):
    """It has ended."""


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
    """In fragment `step`, `delay` seconds after `when`: do these one after the other. Once."""

    step: str
    when: Trigger
    do: tuple[Act, ...]
    delay: Seconds = 0.0


class _Due(Struct, order=True):
    at: Seconds
    number: int
    acts: tuple[Act, ...]


class Human:
    """The person. vary: what to add to the next reaction time, so that no two are alike."""

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
        self._number = 0

    @property
    def deadline(self) -> Seconds | None:
        return self._due[0].at if self._due else None

    def enter(self, now: Seconds) -> None:
        """The person comes in: step 1 begins."""
        self._step = "step-1"
        self._observe("step-1", Entrance(), now)

    def feed(self, message: Message, now: Seconds) -> None:
        """Perceive the robot through a message of the bus; anything else is ignored."""
        match message:
            case BlockProgress(block=str(block), progress="start") if block.startswith("step-"):
                self._step = block
                self._observe(block, Begun(), now)
            case BlockProgress(block=str(block), progress="end"):
                self._observe(block, Ended(), now)
            case WordSpoken(block=block, word=word):
                for text in _words(word):
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
                self.go_on(rule.do, max(now, now + rule.delay + self._vary()))

    def due(self, now: Seconds) -> tuple[Act, ...]:
        """The next acts whose time has come: the first to be done now, the others after it. Empty: nothing is due."""
        if self._due and self._due[0].at <= now:
            return heappop(self._due).acts
        return ()

    def go_on(self, acts: tuple[Act, ...], at: Seconds) -> None:
        """Do these from `at` on."""
        if acts:
            self._number += 1
            heappush(self._due, _Due(at, self._number, acts))


def _words(text: str) -> list[str]:
    return re.findall(r"[a-z']+", text.lower())
