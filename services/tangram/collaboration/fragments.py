"""Turn fragments that the robot says: words, references with their phrases, and the look at the person.

Pure. A reference offers the phrase that names its piece without doubt; its cost is its number of words. A deictic
phrase costs 1 and only singles the piece out together with pointing. Parameters: scenario page, "World".
"""

from collections.abc import Iterable, Sequence

from msgspec import Struct

from engage_hri.schemas.behaviors import (
    Action,
    After,
    Constraint,
    FragmentBehavior,
    Gaze,
    Reference,
    Speech,
    SpeechOption,
)
from engage_hri.schemas.fragments import TurnFragment, TurnStatus
from engage_hri.schemas.tables import Relation, Side
from engage_hri.services.tangram.table import TangramTable

MANIPULATION: tuple[Action, ...] = ("act", "speak", "nod", "shake")
"""Actions that answer a request to move a piece."""

SIDE_WORDS: dict[Side, str] = {"left": "left side", "right": "right side"}
"""Words for sides that are not called by their name alone, as "the top right of" is."""


class PieceMention(Struct, frozen=True, kw_only=True):
    """A reference to a piece within a sentence. deictic: a word ("that") offered besides the phrase."""

    piece: str
    phrase: str
    reliability: float
    deictic: str = ""


Sentence = Sequence[str | PieceMention]


def fragment(
    id: str,
    sentence: Sentence,
    *,
    addressee: str,
    universe: Iterable[str],
    status: TurnStatus = "full",
    look: bool = True,
    accept: tuple[Action, ...] = (),
    delay_target: str = "",
) -> TurnFragment:
    """Make a fragment that says the sentence, part after part.

    look: first look at the addressee; the first word follows the gaze. delay_target: what the robot looks at while it
    holds the turn; empty: it does not hold it. universe: ids of all the pieces there are.
    """
    pieces = tuple(universe)
    behaviors: list[FragmentBehavior] = []
    order: list[Constraint] = []
    previous = ""
    if look:
        behaviors.append(Gaze(id="look", target=addressee))
        previous = "look:stroke"
    for number, part in enumerate(sentence, start=1):
        behavior = _spoken(number, part, pieces)
        if previous:
            after = After(ref=previous, syncs=(f"{behavior.id}:start",))
            order.append(Constraint(id=f"order-{number}", operators=(after,)))
        behaviors.append(behavior)
        previous = f"{behavior.id}:end"
    return TurnFragment(
        id=id, turn_status=status, behaviors=tuple(behaviors), constraints=tuple(order), addressee=addressee,
        accept=accept, delay=bool(delay_target), delay_target=delay_target,
    )  # fmt: skip


def _spoken(number: int, part: str | PieceMention, universe: tuple[str, ...]) -> Speech | Reference:
    if isinstance(part, str):
        return Speech(id=f"speech-{number}", text=part)
    named = SpeechOption(text=part.phrase, cost=float(len(part.phrase.split())))
    options: tuple[SpeechOption, ...] = (named,)
    if part.deictic:
        others = tuple(piece for piece in universe if piece != part.piece)
        options = (SpeechOption(text=part.deictic, cost=1.0, distractors=others, deictic=True), named)
    return Reference(id=f"ref-{number}", target=part.piece, minimum_reliability=part.reliability, options=options)


def name_of(piece: str, table: TangramTable) -> str:
    """The shortest phrase that can mean no other piece: by shape, by color, or by both."""
    this = table.piece(piece)
    others = [other for other in table.pieces if other.id != piece]
    if all(other.shape != this.shape for other in others):
        return f"the {this.shape}"
    if all(other.color != this.color for other in others):
        return f"the {this.color} piece"
    return f"the {this.color} {this.shape}"


def request(
    wanted: Relation,
    table: TangramTable,
    *,
    deictic: str = "",
    asks: str = "Please move",
    piece_reliability: float,
    landmark_reliability: float,
) -> tuple[str | PieceMention, ...]:
    """Word a request, such as "Please move the blue piece so that it is touching the top of the rectangle".

    asks: the words before the piece.
    """
    side = SIDE_WORDS.get(wanted.side, wanted.side)
    landmark = name_of(wanted.landmark, table)
    piece = name_of(wanted.piece, table)
    return (
        asks,
        PieceMention(piece=wanted.piece, phrase=piece, reliability=piece_reliability, deictic=deictic),
        f"so that it is touching the {side} of",
        PieceMention(piece=wanted.landmark, phrase=landmark, reliability=landmark_reliability),
    )
