"""Plans of the collaboration manager, as generators: a plan yields a wish, and is sent the answer to it.

Pure: neither bus nor clock. The service grants the wishes; a test plays the robot and the human by hand.

The scripted plan is the transcript of thesis Appendix B. The robot's words are the source's; steps 7-17 are ours. The
id of a fragment, and of the block of its connection events, is its step; it ends in `ours` where the source has no
such step.
"""

from collections.abc import Generator, Iterable
from typing import TypeVar, cast

from msgspec import Struct

from engage_hri.schemas.fragments import FragmentOutcome, TurnFragment
from engage_hri.schemas.recognition import EngagementLevel
from engage_hri.schemas.tables import Relation, Side
from engage_hri.schemas.units import Probability, Seconds
from engage_hri.schemas.world import Entity
from engage_hri.services.tangram.collaboration.config import CollaborationConfig
from engage_hri.services.tangram.collaboration.fragments import (
    MANIPULATION,
    PieceMention,
    Sentence,
    fragment,
    request,
)
from engage_hri.services.tangram.collaboration.pieces_in_view import has_been_placed
from engage_hri.services.tangram.collaboration.task import Goal, Instruction, check
from engage_hri.services.tangram.table import TangramTable

ATTEMPTS = 3
"""Number of times that the robot asks for one placement before it goes on without. Ours."""
ARRIVAL: Seconds = 4.0
"""Time from when a person is seen until the robot greets them, so that they can sit down. Ours."""
FAREWELL: Seconds = 15.0
"""Time that the robot waits for the person to leave after its goodbye. Ours."""
GONE: Seconds = 2.5
"""Time from a person's leaving until recognition has ended all that was open with them: they might have come back."""
PATIENCE: Seconds = 2.0
"""Time that the robot waits for a hand to go away before it judges what lies where. Ours."""
SETTLE: Seconds = 0.75
"""Time from when a placement is seen until the robot speaks: the person looks up, and the robot looks back. Ours."""
NEXT: Seconds = 2.0
"""Time for which the robot thinks which piece is next. Thesis 6.1.3: about two seconds for each move."""
PAUSE: Seconds = 0.4
"""Time between two turns of the robot. Ours."""
THINKING: Seconds = 1.0
"""Time between "Ummmm," and "good.". Ours."""
PIECE_RELIABILITY: Probability = 0.95
"""Least reliability of a reference to the piece to move, and to the trapezoid when introduced. Scenario page."""
ASKING = {
    "": "Please move",
    "fix": "Please fix",
    "help": "May I help you? I show you what comes next. Please put",
    "again": "Let us try it together. Can you put",
}
"""Words before the piece of a request: the first; of one that was laid wrongly; of one that nobody has moved, which
is then shown; and of one that not even this has moved."""
LANDMARK_RELIABILITY: Probability = 0.85
"""Least reliability of a reference to a landmark, and to the rectangle when introduced. Scenario page."""

# -- what a plan may wish for -----------------------------------------------------------------------------------


class Perform(Struct, frozen=True):
    """Perform the fragment. Answer: its outcome, None if it was refused or failed."""

    fragment: TurnFragment


class Observe(Struct, frozen=True):
    """Look until the place of each piece is certain. Answer: the pieces, with confidence 0 where it is not.

    patience: look at most this long.
    """

    patience: Seconds


class AwaitPlacement(Struct, frozen=True):
    """Wait until the piece has been moved from where it was `before`, and rests. Answer: True if it has.

    timeout: seconds without a piece in anybody's hand.
    """

    piece: str
    before: tuple[Entity, ...]
    timeout: Seconds


class Attendee(Struct, frozen=True):
    """Person who is there. level: how engaged with the robot, as recognition tells. visit: how often they have come.

    is_at_it: they look at what lies on the table, or at the table.
    """

    id: str
    level: EngagementLevel = "unknown"
    visit: int = 1
    is_at_it: bool = False


class LookAround(Struct, frozen=True):
    """Look who is there. Answer: a `Attendee` for each."""


class AwaitPerson(Struct, frozen=True):
    """Wait until a person is there. Answer: an id, that of `known` if this one is there."""

    known: str = ""


class AwaitDeparture(Struct, frozen=True):
    """Wait until nobody is there any more. Answer: True if they have gone."""

    timeout: Seconds


class Pause(Struct, frozen=True):
    seconds: Seconds


Wish = Perform | Observe | AwaitPlacement | LookAround | AwaitPerson | AwaitDeparture | Pause
Answer = FragmentOutcome | tuple[Entity, ...] | tuple[Attendee, ...] | str | bool | None
R = TypeVar("R")
Plan = Generator[Wish, Answer, R]


# -- parts of plans ---------------------------------------------------------------------------------------------


class Manager:
    """Parts that the scripted plan and the plan of the task have in common."""

    def __init__(self, config: CollaborationConfig, table: TangramTable) -> None:
        self.config = config
        self.table = table
        self.goal = Goal(table)
        self._universe = tuple(piece.id for piece in table.pieces)
        self._person = table.person.id
        self._greeted: dict[str, int] = {}
        """Visit for which each person was greeted."""
        self._ignored = 0
        """Number of requests in a row after which nobody laid anything anywhere."""

    def welcome(self) -> Plan[None]:
        """Wait for a person, and let them settle. Who is there then is greeted by the plan."""
        self._person = ""
        yield from self._find()
        self._greeted = {guest.id: guest.visit for guest in (yield from self._company())}

    def _find(self) -> Plan[None]:
        """Go on with the person; with another one, or the next who comes, if this one has left. They may settle."""
        person = yield AwaitPerson(self._person)
        assert isinstance(person, str)
        if person != self._person:
            self._person = person
            yield Pause(ARRIVAL)

    def _meet(self) -> Plan[None]:
        """Go on with the person who is there. Who has come, to make the figure or to attend, is greeted once."""
        yield from self._find()
        for guest in (yield from self._company()):
            is_there_for_it = guest.id == self._person or guest.level in ("engaging", "engaged")
            if is_there_for_it and self._greeted.get(guest.id) != guest.visit:
                self._greeted[guest.id] = guest.visit
                words = "Hello again, let us go on." if guest.visit > 1 else "Hello, we are making a tangram."
                id = f"hello-{guest.id}-{guest.visit}"
                yield Perform(fragment(id, (words,), addressee=guest.id, universe=self._universe))
                yield Pause(PAUSE)

    def _company(self) -> Plan[tuple[Attendee, ...]]:
        guests = yield LookAround()
        return cast("tuple[Attendee, ...]", guests)

    def has_lost(self) -> Plan[bool]:
        """Tell whether the person does nothing, and attends to the robot no more, though they are there.

        Who looks at the pieces thinks, however long: that is no contact with the robot, and no leaving either.
        """
        guests = [guest for guest in (yield from self._company()) if guest.id == self._person]
        attends = [guest.level != "disengaged" or guest.is_at_it for guest in guests]
        return self._ignored >= ATTEMPTS and attends == [False]

    def say(self, id: str, sentence: Sentence, *, look: bool = True) -> Plan[None]:
        """Say a full turn that asks for nothing."""
        yield from self._meet()
        yield Perform(fragment(id, sentence, addressee=self._person, universe=self._universe, look=look))
        yield Pause(PAUSE)

    def approve(self, id: str) -> Plan[None]:
        """Say "Ummmm, good.": look away as if thinking, then look back. Steps 20 and 23 of Appendix B."""
        yield from self._meet()
        yield Perform(
            fragment(
                f"{id}-a", ("Ummmm,",), addressee=self._person, universe=self._universe,
                status="beginning", delay_target=self.table.surface.id,
            )
        )  # fmt: skip
        yield Pause(THINKING)
        yield Perform(
            fragment(f"{id}-b", ("good.",), addressee=self._person, universe=self._universe, status="end", look=False)
        )
        yield Pause(PAUSE)

    def instruct(self, id: str, instruction: Instruction) -> Plan[bool]:
        """Ask for a placement until it is right: with help if nothing happens, for a fix if it is wrong.

        Returns True if it was right in the end.
        """
        request_id, how = id, ""
        pieces = yield from self.observe()
        for attempt in range(1, ATTEMPTS + 1):
            yield from self._meet()
            yield Perform(self._request(request_id, instruction, how))
            placed = yield AwaitPlacement(instruction.wanted.piece, pieces, self.config.placement)
            yield Pause(SETTLE)
            before, pieces = pieces, (yield from self.observe())
            has_moved_any = any(has_been_placed(each.id, before, pieces) for each in pieces)
            self._ignored = 0 if placed or has_moved_any else self._ignored + 1
            verdict = check(instruction, pieces)
            if verdict.right:
                return True
            is_wrong = placed is True and verdict.seen
            how = "fix" if is_wrong else "again" if how == "help" else "help"
            number = f"-{attempt}" if attempt > 1 else ""
            request_id = f"{id}-{how}{number}"
        return False

    def observe(self) -> Plan[tuple[Entity, ...]]:
        """Look at the pieces as they lie."""
        pieces = yield Observe(PATIENCE)
        return cast("tuple[Entity, ...]", pieces)

    def farewell(self) -> Plan[None]:
        yield AwaitDeparture(FAREWELL)
        yield Pause(GONE)

    def _request(self, id: str, instruction: Instruction, how: str) -> TurnFragment:
        """how: key of `ASKING`. Whoever is helped is shown the place, too."""
        sentence = request(
            instruction.wanted,
            self.table,
            asks=ASKING[how],
            deictic="" if how else instruction.deictic,
            piece_reliability=PIECE_RELIABILITY,
            landmark_reliability=PIECE_RELIABILITY if how == "help" else LANDMARK_RELIABILITY,
        )
        return fragment(id, sentence, addressee=self._person, universe=self._universe, accept=MANIPULATION)

    def introduction(self) -> tuple[str | PieceMention, ...]:
        """Sentence that introduces the pieces on the table. Step 3 of Appendix B."""
        return (
            "We are going to use the pieces on the table to make a picture together. "
            "As you can see, on the table we have: squares, triangles,",
            PieceMention(piece="rectangle", phrase="a rectangle", reliability=LANDMARK_RELIABILITY),
            "and",
            PieceMention(piece="trapezoid", phrase="a trapezoid", reliability=PIECE_RELIABILITY),
            "of different colors.",
        )


# -- whole plans ------------------------------------------------------------------------------------------------


class Turn(Struct, frozen=True, kw_only=True):
    """A row of a script: words to `say`, a placement to ask for, or, with neither, "Ummmm, good."."""

    step: str
    say: tuple[str | PieceMention, ...] = ()
    instruction: Instruction | None = None
    look: bool = True


def script(manager: Manager, turns: Iterable[Turn]) -> Plan[None]:
    """Play a script row by row; a placement that stays wrong does not end it."""
    yield from manager.welcome()
    for turn in turns:
        if turn.instruction is not None:
            yield from manager.instruct(turn.step, turn.instruction)
        elif turn.say:
            yield from manager.say(turn.step, turn.say, look=turn.look)
        else:
            yield from manager.approve(turn.step)
    yield from manager.farewell()


def task(manager: Manager) -> Plan[None]:
    """Make the figure with the person: ask for one piece after the other, each chosen from the table as it is."""
    yield from manager.welcome()
    yield from manager.say("hello", ("Hello, let's make a tangram.",))
    yield from manager.say("pieces", manager.introduction(), look=False)
    yield from manager.say("start", ("Okay, let's start.",))
    given_up: set[str] = set()
    number = 0
    while True:
        pieces = yield from manager.observe()
        instruction = manager.goal.next(pieces, given_up)
        if instruction is None:
            break
        yield Pause(NEXT)
        number += 1
        if (yield from manager.instruct(f"move-{number}", instruction)):
            yield from manager.approve(f"good-{number}")
        else:
            given_up.add(instruction.wanted.piece)
            if (yield from manager.has_lost()):
                yield from manager.say("let-go", ("You have other things to do. Thank you for playing, goodbye.",))
                return
    finished = "Look, we made an anchor."
    if given_up:
        is_begun = len(manager.goal.placed(pieces)) > 1
        finished = "Look, we almost made an anchor." if is_begun else "Let us make the anchor another time."
    yield from manager.say("finished", (finished,), look=False)
    yield from manager.say("goodbye", ("Thanks for playing. That was fun, goodbye.",), look=False)
    yield from manager.farewell()


# -- Appendix B ---------------------------------------------------------------------------------------------------


AS_IN_STEP_19 = Relation("purple-triangle", "top right", "trapezoid")
"""Place where the human puts the piece, against step 18; the robot says "good" in step 20 all the same."""


def asks(step: str, piece: str, side: Side, landmark: str, deictic: str = "", *also: Relation) -> Turn:
    """A request for a placement. deictic: the word that may stand for the piece. also: other places that will do."""
    wanted = Relation(piece, side, landmark)
    return Turn(step=step, instruction=Instruction(wanted=wanted, deictic=deictic, also=also))


def turns(manager: Manager) -> tuple[Turn, ...]:
    """The robot's turns in order; the human's steps (1, 6, 19, 22, 26) lie between them."""
    return (
        Turn(step="step-2", say=("Hello, let's make a tangram.",)),
        Turn(step="step-3", say=manager.introduction(), look=False),
        Turn(step="step-4", say=("Okay, let's start.",)),
        asks("step-5", "blue-square", "top", "rectangle"),
        *OURS,
        asks("step-18", "purple-triangle", "top right", "pink-square", "that", AS_IN_STEP_19),
        Turn(step="step-20"),
        asks("step-21", "green-square", "left", "blue-square", "this"),
        Turn(step="step-23"),
        Turn(step="step-24", say=("Look, we made an anchor.",), look=False),
        Turn(step="step-25", say=("Thanks for playing. That was fun, goodbye.",), look=False),
    )


OURS = (
    Turn(step="step-7-ours"),
    asks("step-8-ours", "trapezoid", "top", "blue-square"),
    Turn(step="step-9-ours"),
    asks("step-10-ours", "yellow-triangle", "bottom", "rectangle"),
    Turn(step="step-11-ours"),
    asks("step-12-ours", "red-square", "bottom left", "yellow-triangle"),
    Turn(step="step-13-ours"),
    asks("step-14-ours", "pink-square", "bottom right", "yellow-triangle"),
    Turn(step="step-15-ours"),
    asks("step-16-ours", "pink-triangle", "top left", "red-square"),
    asks("step-17-ours", "purple-square", "right", "blue-square"),
)
