"""A person who does what the robot's words say: hears which piece goes where, and moves it there.

Pure. They know the pieces by color and shape, the eight directions, and that "this" is what the robot points at.
For managers whose plan nobody knows beforehand; the words must be those of the tangram's requests.
"""

import re
from collections.abc import Callable

from schemas.actions import ActionBegan, ActionEnded
from schemas.body import WordSpoken
from schemas.feedback import BlockProgress
from schemas.messages import Message
from schemas.units import Seconds
from services.simulation.human import (
    FACE,
    TABLE,
    Act,
    Grab,
    Human,
    Lay,
    Leave,
    LookAt,
    Pause,
    Sit,
    Withdraw,
)
from services.tangram_table import SIDES, Side, TangramTable

REQUEST = re.compile(
    r"(?:move|fix|put) (?P<piece>.+?) so that it is touching the (?P<side>[a-z ]+?) of (?P<landmark>.+)"
)
POINTED = ("this", "that")


class ListeningHuman(Human):
    """Looks where the robot points and at its face in between; answers each request by a placement. Leaves after
    "goodbye".
    """

    def __init__(self, table: TangramTable, robot: str = "robot", vary: Callable[[], Seconds] = lambda: 0.0) -> None:
        super().__init__((), robot, vary)
        self._table = table
        self._words: dict[str, list[str]] = {}
        self._pointed: dict[str, str] = {}
        self._pointing_at = ""

    def enter(self, now: Seconds) -> None:
        self.go_on((LookAt(TABLE), Pause(0.8), Sit(), Pause(0.8), LookAt(FACE)), now)

    def feed(self, message: Message, now: Seconds) -> None:
        match message:
            case WordSpoken(block=block, word=word):
                self._words.setdefault(block, []).append(word)
                if self._pointing_at:
                    self._pointed[block] = self._pointing_at
            case ActionBegan(actor=actor, action="point", targets=(target,)) if actor == self._robot:
                self._pointing_at = target
                self._react((LookAt(target),), 0.3, now)
            case ActionEnded(actor=actor, action="point") if actor == self._robot:
                self._pointing_at = ""
            case BlockProgress(block=str(block), progress="end") if block in self._words:
                self._react(self._answer(block), 0.5, now)

    def _react(self, acts: tuple[Act, ...], delay: Seconds, now: Seconds) -> None:
        self.go_on(acts, max(now, now + delay + self._vary()))

    def _answer(self, block: str) -> tuple[Act, ...]:
        """What the words of a whole block make the person do."""
        words = " ".join(re.sub(r"[^a-z' ]", "", " ".join(self._words.pop(block)).lower()).split())
        pointed = self._pointed.pop(block, "")
        if "goodbye" in words:
            return (LookAt(TABLE), Pause(1.0), LookAt(FACE), Pause(1.0), Leave())
        request = REQUEST.search(words)
        if request is None:
            return (LookAt(FACE),)
        piece = pointed if request["piece"] in POINTED else self._meant(request["piece"])
        landmark = self._meant(request["landmark"])
        side = self._side(request["side"])
        if not piece or not landmark or side is None:
            return (LookAt(FACE),)
        lay = Lay(piece, side, landmark)
        return (LookAt(piece), Pause(0.3), Grab(piece), LookAt(landmark), lay, Withdraw(), Pause(0.2), LookAt(FACE))

    def _meant(self, phrase: str) -> str:
        """The one piece whose color and shape agree with the phrase; empty if none or several do."""
        words = set(phrase.split()) - {"the", "a", "piece"}
        meant = [piece.id for piece in self._table.pieces if words <= {piece.color, piece.shape}]
        return meant[0] if words and len(meant) == 1 else ""

    def _side(self, words: str) -> Side | None:
        name = words.removesuffix(" side")
        return next((side for side in SIDES if side == name), None)
