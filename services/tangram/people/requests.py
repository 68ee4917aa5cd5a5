"""Understanding of the robot's requests: the piece that it wants, and where.

Pure. Known are the pieces by color and shape, the eight directions, and that "this" is the piece at which the robot
points. The words must be those of the tangram's requests.
"""

import re

from engage_hri.schemas.footprints import SIDES
from engage_hri.services.simulation.human import Lay
from engage_hri.services.simulation.speech import HeardSpeech
from engage_hri.services.tangram.table import TangramTable

REQUEST = re.compile(
    r"(?:move|fix|put) (?P<piece>.+?) so that it is touching the (?P<side>[a-z ]+?) of (?P<landmark>.+)"
)
POINTED = ("this", "that")


def is_request(utterance: HeardSpeech) -> bool:
    """Tell whether the robot asks for a piece to be laid somewhere."""
    return REQUEST.search(utterance.words) is not None


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
