"""Understanding of the robot's words: the piece that it wants, and where.

Pure. Known are the pieces by color and shape, the eight directions, and that "this" is the piece at which the robot
points. The words must be those of the tangram's requests.
"""

import re

from msgspec import Struct

from engage_hri.schemas.actions import ActionBegan, ActionEnded
from engage_hri.schemas.body import WordSpoken
from engage_hri.schemas.body_faults import BodyFaults
from engage_hri.schemas.feedback import BlockProgress
from engage_hri.schemas.footprints import SIDES
from engage_hri.schemas.messages import Message
from engage_hri.services.simulation.human import Lay
from engage_hri.services.tangram.table import TangramTable

REQUEST = re.compile(
    r"(?:move|fix|put) (?P<piece>.+?) so that it is touching the (?P<side>[a-z ]+?) of (?P<landmark>.+)"
)
POINTED = ("this", "that")
THINKING = "ummmm"
"""Words of a robot that will go on speaking: they need no answer."""


class HeardSpeech(Struct, frozen=True):
    """Words of a block of the robot, lower case without punctuation, and the piece at which it pointed meanwhile."""

    words: str
    pointed: str = ""
    is_question: bool = False

    @property
    def is_request(self) -> bool:
        return REQUEST.search(self.words) is not None


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


def requested_placement(utterance: HeardSpeech, table: TangramTable) -> Lay | None:
    """The placement for which the robot asks; None if it asks for none, or if words and pointing leave it open."""
    request = REQUEST.search(utterance.words)
    if request is None:
        return None
    piece = utterance.pointed if request["piece"] in POINTED else _piece_called(request["piece"], table)
    landmark = _piece_called(request["landmark"], table)
    side = next((side for side in SIDES if side == request["side"].removesuffix(" side")), None)
    return Lay(piece, side, landmark) if piece and landmark and side else None


def _piece_called(phrase: str, table: TangramTable) -> str:
    """Id of the only piece with the color and shape of the phrase; empty if none or several have them."""
    words = set(phrase.split()) - {"the", "a", "piece"}
    meant = [piece.id for piece in table.pieces if words <= {piece.color, piece.shape}]
    return meant[0] if words and len(meant) == 1 else ""
