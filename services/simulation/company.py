"""People who sit with the robot: two who listen to it, and what perception tells of whoever sits there. Pure.

One who listens moves pieces as the robot's words ask, another attends to its gaze as well. Both are meant for
managers without a plan that is known beforehand. The attentive one is for first meetings: it looks where the robot
looks and points, meets its eyes, and answers with a nod or a yes; it knows no task but that of which it is told.
"""

from collections.abc import Callable, Iterator, Mapping

from engage_hri.schemas.messages import Message
from engage_hri.schemas.perception import ActionBegan, Utterance
from engage_hri.schemas.units import Seconds, Stamp
from engage_hri.services.client.people.actions import PersonActions
from engage_hri.services.reports.ongoing_actions import ActionEvent
from engage_hri.services.simulation.human import (
    FACE,
    TABLE,
    THINKING,
    Act,
    Ears,
    Grab,
    HeardSpeech,
    Hearing,
    Human,
    Lay,
    Leave,
    LookAt,
    Pause,
    Sit,
    SpokenWords,
    Start,
    Stop,
    Withdraw,
    speech,
)

COMES: tuple[Act, ...] = (LookAt(TABLE), Pause(0.8), Sit(), Pause(0.8), LookAt(FACE))
GOES: tuple[Act, ...] = (LookAt(TABLE), Pause(1.0), LookAt(FACE), Pause(1.0), Leave())


def moves(lay: Lay, hesitates: Seconds = 0.3) -> tuple[Act, ...]:
    """Acts that take a piece and lay it at its place.

    hesitates: time for which the person looks at it before.
    """
    return (LookAt(lay.piece), Pause(hesitates), Grab(lay.piece), LookAt(lay.landmark), lay, Withdraw())


class ListeningHuman(Human):
    """The listening person: looks where the robot points, at its face in between, and leaves after "goodbye".

    asked: finds the placement for which an utterance asks, which is then the answer; None: it asks for none.
    """

    ANSWERS: Seconds = 0.5
    """Delay from the end of the robot's words to the answer."""
    FOLLOWS: Seconds = 0.3
    """Delay from the robot's point, or look, to the person's look."""
    ACKNOWLEDGES: tuple[Act, ...] = (LookAt(FACE),)
    """Answer to words that ask for nothing."""

    def __init__(
        self,
        asked: Callable[[HeardSpeech], Lay | None],
        robot: str = "robot",
        vary: Callable[[], Seconds] = lambda: 0.0,
    ) -> None:
        super().__init__((), robot, vary)
        self._asked = asked
        self._hearing = Hearing(robot)

    def enter(self, now: Seconds) -> None:
        self.schedule(COMES, now)

    def feed(self, message: Message, now: Seconds) -> None:
        match message:
            case ActionBegan(actor=self._robot, action="point", targets=(target,)):
                self._react((LookAt(target, pointed=True),), self.FOLLOWS, now)
        self._listen(message, now)

    def _listen(self, message: Message, now: Seconds) -> None:
        utterance = self._hearing.feed(message)
        if utterance is not None and (acts := self._answer(utterance)):
            self._react(acts, self.ANSWERS, now)

    def _react(self, acts: tuple[Act, ...], delay: Seconds, now: Seconds) -> None:
        self.schedule(acts, max(now, now + delay + self._vary()))

    def _answer(self, utterance: HeardSpeech) -> tuple[Act, ...]:
        """Acts that answer the words of a whole block."""
        if "goodbye" in utterance.words:
            return GOES
        lay = self._asked(utterance)
        return self.ACKNOWLEDGES if lay is None else (*moves(lay), Pause(0.2), LookAt(FACE))


class AttentiveHuman(ListeningHuman):
    """The attentive person. person: its id. sees: ids it can look at. asked: see `ListeningHuman`.

    Delays: the means of Table 2.1.
    """

    ANSWERS: Seconds = 0.4
    FOLLOWS: Seconds = 0.3
    ACKNOWLEDGES: tuple[Act, ...] = (Start("nod"), Pause(0.5), Stop("nod"), LookAt(FACE))
    AGREES: tuple[Act, ...] = (*speech("Yes."), LookAt(FACE))
    """Answer to a question."""

    def __init__(
        self,
        person: str,
        sees: frozenset[str],
        robot: str = "robot",
        vary: Callable[[], Seconds] = lambda: 0.0,
        asked: Callable[[HeardSpeech], Lay | None] = lambda utterance: None,
    ) -> None:
        super().__init__(asked, robot, vary)
        self._person = person
        self._sees = sees

    def feed(self, message: Message, now: Seconds) -> None:
        match message:
            case ActionBegan(actor=self._robot, action="look" | "point" as action, targets=(target, *_)):
                if target == self._person:
                    self._react((LookAt(FACE),), self.FOLLOWS, now)
                elif target in self._sees:
                    self._react((LookAt(target, pointed=action == "point"),), self.FOLLOWS, now)
        self._listen(message, now)

    def _answer(self, utterance: HeardSpeech) -> tuple[Act, ...]:
        if utterance.words == THINKING:
            return ()
        answer = super()._answer(utterance)
        return self.AGREES if answer == self.ACKNOWLEDGES and utterance.is_question else answer


class Bystander:
    """Actions and words of a person who looks, gestures and speaks, and moves nothing.

    life: of the program that tells of the person.
    """

    def __init__(self, person: str, robot: str, life: str = "") -> None:
        self._robot = robot
        self._actions = PersonActions(person)
        self._actions.is_here = True
        self._words = SpokenWords(person, life)

    def does(self, act: Act, at: Stamp) -> Iterator[ActionEvent | Utterance]:
        yield from self._words.does(act, at)
        match act:
            case LookAt(target=target):
                yield from self._actions.looks((self._robot if target == FACE else target,) if target else (), at)
            case Start(action=action, target=target):
                yield from self._actions.begins(action, (target,) if target else (), at)
            case Stop(action=action, target=target):
                yield from self._actions.ends(action, (target,) if target else (), at)


class Company:
    """People who sit there and are found at once. humans: what each does, by actor id.

    life: of the program that tells of them.
    """

    def __init__(self, humans: Mapping[str, Human], robot: str, life: str = "") -> None:
        self._humans = humans
        self._bodies = {person: Bystander(person, robot, life) for person in humans}
        self._ears = Ears()

    @property
    def deadline(self) -> Seconds | None:
        """Time at which `advance` has something to do; None: not before the robot does something."""
        return min((at for human in self._humans.values() if (at := human.deadline) is not None), default=None)

    def feed(self, message: Message, now: Seconds) -> None:
        """Take a message about the robot."""
        if self._ears.hear(message):
            self._hear(message, now)

    def _hear(self, message: Message, now: Seconds) -> None:
        for human in self._humans.values():
            human.feed(message, now)

    def advance(self, now: Seconds, stamp: Stamp) -> Iterator[ActionEvent | Utterance]:
        """Acts that are due, as perception tells of them. stamp: of `now`."""
        for person, human in self._humans.items():
            while acts := human.due(now):
                yield from self._bodies[person].does(acts[0], stamp)
                human.schedule(acts[1:], now + (acts[0].seconds if isinstance(acts[0], Pause) else 0.0))
