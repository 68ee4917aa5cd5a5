"""What a person makes of the robot's words: which piece it wants where.

Pure. They know the pieces by color and shape, the eight directions, and that "this" is what the robot points at. The
words must be those of the tangram's requests.
"""

import re

from msgspec import Struct

from engage_hri.schemas.actions import ActionBegan, ActionEnded
from engage_hri.schemas.body import WordSpoken
from engage_hri.schemas.feedback import BlockProgress
from engage_hri.schemas.messages import Message
from engage_hri.services.simulation.human import Lay
from engage_hri.services.tangram.table import SIDES, Side, TangramTable

REQUEST = re.compile(
    r"(?:move|fix|put) (?P<piece>.+?) so that it is touching the (?P<side>[a-z ]+?) of (?P<landmark>.+)"
)
POINTED = ("this", "that")
THINKING = "ummmm"
"""Said by a robot that will go on: nothing to answer."""


class HeardSpeech(Struct, frozen=True):
    """The words of a block of the robot, in lower case without punctuation, and what it pointed at meanwhile."""

    words: str
    pointed: str = ""

    @property
    def is_request(self) -> bool:
        return REQUEST.search(self.words) is not None


class Hearing:
    """Puts words together until their block has ended."""

    def __init__(self, robot: str) -> None:
        self._robot = robot
        self._words: dict[str, list[str]] = {}
        self._pointed: dict[str, str] = {}
        self._pointing_at = ""

    def feed(self, message: Message) -> HeardSpeech | None:
        """Perceive the robot. The utterance that is over now, if one is."""
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
                words = re.sub(r"[^a-z' ]", "", " ".join(self._words.pop(block)).lower()).split()
                return HeardSpeech(" ".join(words), self._pointed.pop(block, ""))
        return None


def wanted(utterance: HeardSpeech, table: TangramTable) -> Lay | None:
    """The placement that is asked for; None if none is, or the words and the pointing don't tell which."""
    request = REQUEST.search(utterance.words)
    if request is None:
        return None
    piece = utterance.pointed if request["piece"] in POINTED else _meant(request["piece"], table)
    landmark, side = _meant(request["landmark"], table), _side(request["side"])
    return Lay(piece, side, landmark) if piece and landmark and side else None


def _meant(phrase: str, table: TangramTable) -> str:
    """The one piece whose color and shape agree with the phrase; empty if none or several do."""
    words = set(phrase.split()) - {"the", "a", "piece"}
    meant = [piece.id for piece in table.pieces if words <= {piece.color, piece.shape}]
    return meant[0] if words and len(meant) == 1 else ""


def _side(words: str) -> Side | None:
    name = words.removesuffix(" side")
    return next((side for side in SIDES if side == name), None)
