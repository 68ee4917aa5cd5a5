"""People who listen: one moves pieces as the robot's words ask, another attends to the robot's gaze as well. Pure.

Both are meant for managers without a plan that is known beforehand. The attentive one is for first meetings: it looks
where the robot looks and points, meets its eyes, and answers with a nod or a yes; it knows no task but that of which
it is told.
"""

from collections.abc import Callable

from engage_hri.schemas.messages import Message
from engage_hri.schemas.perception import ActionBegan
from engage_hri.schemas.units import Seconds
from engage_hri.services.simulation.human import (
    FACE,
    TABLE,
    THINKING,
    Act,
    Grab,
    HeardSpeech,
    Hearing,
    Human,
    Lay,
    Leave,
    LookAt,
    Pause,
    Sit,
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
