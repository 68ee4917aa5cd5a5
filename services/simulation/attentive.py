"""A person who is all attention: looks where the robot looks and points, meets its eyes, and nods when it has spoken.

Pure. For first meetings: they know no task but the placements of the tangram, and need no table for the rest.
"""

from collections.abc import Callable

from engage_hri.schemas.actions import ActionBegan
from engage_hri.schemas.messages import Message
from engage_hri.schemas.units import Seconds
from engage_hri.services.simulation.hearing import Hearing, Utterance, wanted
from engage_hri.services.simulation.human import FACE, Act, Human, LookAt, Pause, Start, Stop
from engage_hri.services.simulation.listening import COMES, GOES, moves
from engage_hri.services.tangram.table import TangramTable

FOLLOWS: Seconds = 0.3
"""From the robot's look or point to theirs; thesis, Table 2.1."""
ANSWERS: Seconds = 0.4
"""From the end of its turn to the answer; thesis, Table 2.1."""
NOD: tuple[Act, ...] = (Start("nod"), Pause(0.5), Stop("nod"))
THINKING = "ummmm"
"""Said by a robot that will go on: nothing to answer."""


class AttentiveHuman(Human):
    """person: who they are. sees: what there is to look at. table: whose pieces they move when asked; None: none."""

    def __init__(
        self,
        person: str,
        sees: frozenset[str],
        robot: str = "robot",
        vary: Callable[[], Seconds] = lambda: 0.0,
        table: TangramTable | None = None,
    ) -> None:
        super().__init__((), robot, vary)
        self._person = person
        self._sees = sees
        self._table = table
        self._hearing = Hearing(robot)

    def enter(self, now: Seconds) -> None:
        self.go_on(COMES, now)

    def feed(self, message: Message, now: Seconds) -> None:
        match message:
            case ActionBegan(actor=self._robot, action="look" | "point", targets=(target, *_)):
                if target == self._person:
                    self._react((LookAt(FACE),), FOLLOWS, now)
                elif target in self._sees:
                    self._react((LookAt(target),), FOLLOWS, now)
        utterance = self._hearing.feed(message)
        if utterance is not None and utterance.words != THINKING:
            self._react(self._answer(utterance), ANSWERS, now)

    def _react(self, acts: tuple[Act, ...], delay: Seconds, now: Seconds) -> None:
        self.go_on(acts, max(now, now + delay + self._vary()))

    def _answer(self, utterance: Utterance) -> tuple[Act, ...]:
        """What the words of a whole block make the person do."""
        if "goodbye" in utterance.words.split():
            return GOES
        lay = None if self._table is None else wanted(utterance, self._table)
        return (*NOD, LookAt(FACE)) if lay is None else (*moves(lay), Pause(0.2), LookAt(FACE))
