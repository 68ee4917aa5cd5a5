"""An attentive person: looks where the robot looks and points, meets its eyes, and answers with a nod or a yes.

Pure. This person is for first meetings: it knows no task but that of which it is told.
"""

from collections.abc import Callable

from engage_hri.schemas.messages import Message
from engage_hri.schemas.perception import ActionBegan
from engage_hri.schemas.units import Seconds
from engage_hri.services.simulation.hearing import THINKING, HeardSpeech
from engage_hri.services.simulation.human import FACE, Act, Lay, LookAt, Pause, Start, Stop
from engage_hri.services.simulation.listening import ListeningHuman
from engage_hri.services.simulation.speaking import speech


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
