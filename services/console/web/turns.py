"""Turns of speech for the page: all that a speaker says in one turn, and what of it was not said. Pure.

The robot says a turn in many speeches, for between them it looks and points; several blocks may make one turn. The
net of a block tells which words it is to say (`NetPlanned.speeches`), so that what is missing at its end is known.
"""

from collections import deque
from collections.abc import Collection, Iterable
from itertools import groupby
from typing import Literal, NamedTuple

from engage_hri.schemas.blocks import BlockOutcome, BlockProgress, Hold, NetPlanned
from engage_hri.schemas.body import WordSpoken
from engage_hri.schemas.messages import Message
from engage_hri.schemas.participants import PeerAlive, PeerGone
from engage_hri.schemas.text import joined
from engage_hri.schemas.units import Seconds
from engage_hri.services.console.view import OWN_BLOCKS, UtteranceInView
from engage_hri.services.console.web.sections import Left, UtteranceShown, Zero

TURNS_KEPT = 30
BLOCKS_KEPT = 160
EARLY: Seconds = 0.2
"""Time by which words may seem to begin before their block, as both are measured."""
State = Literal["", "held", "stopped", "failed", "lost", "left"]
"""`held`: it waits. `left`: the turn went on without some words. The others: its block ended before its words did."""
ENDS: dict[str, State] = {"interrupted": "stopped", "failed": "failed", "lost": "lost", "done": "left"}
"""State of a turn whose words were not all said, by the end of its block."""


class _Block:
    """A block in the order of its time. turn: the block with which the turn began. status: empty while it runs."""

    def __init__(self, id: str, began: Seconds) -> None:
        self.id = id
        self.began = began
        self.turn: _Block = self
        self.texts: dict[str, str] = {}
        """Text of each speech, in the order of the block."""
        self.positions: dict[str, int] = {}
        """Characters that were said of each speech."""
        self.spoken: dict[str, str] = {}
        """Words that were said of each speech, as the end of the block told."""
        self.status = ""


class _Piece(NamedTuple):
    """A piece of a turn. is_over: its speech has ended, or will not begin."""

    text: str
    is_said: bool
    is_over: bool


class ShownTurns:
    """The blocks of which words may be shown."""

    def __init__(self) -> None:
        self._blocks: deque[_Block] = deque(maxlen=BLOCKS_KEPT)
        self._life = ""
        """Life of the realizer; empty: unknown."""

    def feed(self, message: Message, at: Seconds) -> bool:
        """Take a message. at: its local instant. Returns whether it may change what is shown."""
        match message:
            case BlockProgress(block=str() as id) | NetPlanned(block=id) if id.startswith(OWN_BLOCKS):
                return False
            case BlockProgress(block=str() as id, progress="start"):
                self._blocks.append(_Block(id, at))
            case BlockProgress(block=str() as id, status=status):
                self._block(id, at).status = status
            case BlockOutcome(block=id, spoken=spoken):
                self._block(id, at).spoken = {each.behavior: each.text for each in spoken}
            case NetPlanned(block=id, speeches=speeches, follows=follows):
                block = self._block(id, at)
                block.texts = {each.behavior: each.text for each in speeches}
                if (before := self._find(follows[0]) if follows else None) is not None and before is not block:
                    block.turn = before.turn
            case WordSpoken(block=id, behavior=behavior, position=position):
                self._block(id, at).positions[behavior] = position
            case PeerAlive(participant="realizer", run=run):
                if run == self._life:
                    self._change("lost", "")
                self._life = run
            case PeerGone(participant="realizer"):
                self._change("", "lost")
            case _:
                return False
        return True

    def words(self, id: str) -> str:
        """All words of a block, whether they are said yet or not; empty: it has none, or is unknown."""
        block = self._find(id)
        return joined(block.texts.values()) if block is not None else ""

    def _find(self, id: str, at: Seconds | None = None) -> _Block | None:
        """The newest block of this name. at: that began by then."""
        found = (each for each in reversed(self._blocks) if each.id == id)
        return next((each for each in found if at is None or each.began <= at + EARLY), None)

    def _block(self, id: str, at: Seconds) -> _Block:
        if (found := self._find(id)) is None:
            self._blocks.append(found := _Block(id, at))
        return found

    def _change(self, status: str, other: str) -> None:
        for each in self._blocks:
            if each.status == status:
                each.status = other

    # -- what is shown --------------------------------------------------------------------------------------------

    def shown(self, said: Iterable[UtteranceInView], holds: Collection[Hold], zero: Zero) -> list[UtteranceShown]:
        """Turns of all speakers, the oldest first. said: speeches, in any order. holds: those in force."""
        speeches = sorted(said, key=lambda each: each.began)
        turns = dict[object, list[tuple[UtteranceInView, _Block | None]]]()
        for number, each in enumerate(speeches):
            block = self._find(each.behavior.partition(":")[0], each.began) if each.behavior else None
            turns.setdefault(number if block is None else block.turn, []).append((each, block))
        return [_turn(parts, holds, zero) for parts in list(turns.values())[-TURNS_KEPT:]]


def _turn(parts: list[tuple[UtteranceInView, _Block | None]], holds: Collection[Hold], zero: Zero) -> UtteranceShown:
    """One turn. parts: its speeches, by their beginning."""
    first, begun_in = parts[0]
    if begun_in is None:
        settled = 0 if first.open else len(first.text)
        return UtteranceShown(first.actor, zero(first.began), first.text, first.open, settled)
    blocks = list(dict.fromkeys(block for _, block in parts if block is not None))
    pieces, states = list[_Piece](), list[State]()
    for block in blocks:
        speeches = {each.behavior.partition(":")[2]: each for each, of in parts if of is block}
        state = _state(block, holds)
        found = list(_pieces(block, speeches, is_waiting=state == "held"))
        pieces += found
        states += [state] if state == "held" or any(not each.is_said for each in found) else []
    words, left, settled = _put_together(pieces)
    is_open = any(each.open for each, _ in parts) or not all(block.status for block in blocks)
    return UtteranceShown(first.actor, zero(first.began), words, is_open, settled, left, states[-1] if states else "")


def _state(block: _Block, holds: Collection[Hold]) -> State:
    if block.status:
        return ENDS.get(block.status, "left")
    return "held" if any(each.block in ("", block.id) for each in holds) else "left"


def _pieces(block: _Block, speeches: dict[str, UtteranceInView], *, is_waiting: bool) -> Iterable[_Piece]:
    """Pieces of a block, in its order. is_waiting: also those that are to come."""
    for id in dict.fromkeys((*block.texts, *speeches)):
        speech, text = speeches.get(id), block.texts.get(id, "")
        is_over = bool(block.status) or (speech is not None and not speech.open)
        cut = _cut(block, id, speech)
        said = (text[:cut] if cut is not None else "") or (speech.text if speech is not None else "")
        if said:
            yield _Piece(said, True, is_over)
        rest = text[cut:].strip() if cut is not None else ""
        if (is_over or is_waiting) and any(map(str.isalnum, rest)):
            yield _Piece(rest, False, is_over)


def _cut(block: _Block, id: str, speech: UtteranceInView | None) -> int | None:
    """Characters of a speech that were said; None: nobody knows, as of a voice that tells no words.

    Of such a voice a speech that has ended counts as said, until the end of the block tells more.
    """
    text = block.texts.get(id, "")
    if (spoken := block.spoken.get(id)) is not None:
        return len(spoken) if text.startswith(spoken) else None
    if id in block.positions:
        return block.positions[id]
    if speech is None:
        return 0
    return None if speech.open else len(text)


def _put_together(pieces: Iterable[_Piece]) -> tuple[str, tuple[Left, ...], int]:
    """Words that were said, those that were not with their places, and the number of characters that are settled."""
    said, left, settled, is_settled = list[str](), list[Left](), 0, True
    for is_said, group in groupby(pieces, key=lambda each: each.is_said):
        members = list(group)
        if not is_said:
            left.append(Left(len(joined(said)), joined(each.text for each in members)))
            continue
        for each in members:
            said.append(each.text)
            is_settled = is_settled and each.is_over
            settled = len(joined(said)) if is_settled else settled
    return joined(said), tuple(left), settled
