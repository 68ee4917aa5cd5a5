"""BML blocks and what became of them."""

from typing import Literal

from msgspec import Struct

from engage_hri.schemas.behaviors import BlockBehavior, Constraint
from engage_hri.schemas.faults import Fault
from engage_hri.schemas.feedback import WarningKind
from engage_hri.schemas.requests import Outcome, Request

Composition = Literal["MERGE", "APPEND", "REPLACE"]
Dialect = Literal["draft", "bml-1.0"]


class Unread(Struct, frozen=True, kw_only=True, omit_defaults=True):
    """Something in a block that its reader did not understand and left out. behavior empty: of the block itself."""

    message: str
    behavior: str = ""
    kind: WarningKind = "PARSING_FAILURE"


class Block(Struct, frozen=True, kw_only=True, tag="block", omit_defaults=True):
    """A BML behavior block: behaviors and the constraints between their sync points.

    id: the manager's name for it; no other live block has it.
    behaviors: in any order; constraints and their own timing say when.
    constraints: between sync points of these behaviors, or of live blocks.
    composition: beside what runs (`MERGE`), after it (`APPEND`), or in its place (`REPLACE`).
    dialect: how its author spells sync points; feedback about the block is spelled the same way.
    """

    id: str
    behaviors: tuple[BlockBehavior, ...] = ()
    constraints: tuple[Constraint, ...] = ()
    composition: Composition = "MERGE"
    dialect: Dialect = "draft"
    character_id: str = ""
    """Whom its author means to perform it. Feedback repeats it; the robot on the bus performs it in any case."""
    unread: tuple[Unread, ...] = ()
    """The realizer warns of each when the block begins."""


class PerformBlock(Request, frozen=True, kw_only=True, tag="perform_block", omit_defaults=True):
    """cmd: collaboration or generation -> realizer. Terminal state: `BlockOutcome`.

    follows: ids of live blocks whose turn it goes on with. If one of them fails, is refused or is interrupted, this
    one is interrupted in the same instant, and says so after it. Refused if one of them is not live.
    """

    block: Block
    follows: tuple[str, ...] = ()


class InterruptBehavior(Request, frozen=True, kw_only=True, tag="interrupt_behavior", omit_defaults=True):
    """cmd: anyone -> realizer: end one behavior of a live block now. Terminal state: `BehaviorInterrupted`.

    The others go on. Gestures relax, speech ends at a word. What it has not reached is as if it had not been written,
    even of a required behavior: who asks for its end does not miss it. To end a whole block, cancel its request.
    """

    block: str
    behavior: str


class BehaviorInterrupted(Outcome, frozen=True, kw_only=True, tag="behavior_interrupted", omit_defaults=True):
    """evt: realizer -> requester. spoken: of a speech, the words that were said.

    was_done: it came to its end before it could be ended.
    """

    block: str
    behavior: str
    spoken: str = ""
    was_done: bool = False


class SpokenText(Struct, frozen=True, kw_only=True, omit_defaults=True):
    """What was said of a speech: all of it, or the words before the interruption."""

    behavior: str
    text: str
    complete: bool = True


class BlockOutcome(Outcome, frozen=True, kw_only=True, tag="block_outcome", omit_defaults=True):
    """evt: realizer -> requester. Exactly one per accepted block.

    interrupted with `replaced_by` set: another block's REPLACE ended it.
    """

    block: str
    status: Literal["done", "failed", "interrupted"]
    spoken: tuple[SpokenText, ...] = ()
    dropped: tuple[str, ...] = ()
    """Ids of behaviors that were dropped, each with its warning on the feedback stream."""
    reasons: tuple[str, ...] = ()
    """Of each of them in turn, why, as the warning has it."""
    interrupted: tuple[str, ...] = ()
    """Ids of behaviors that somebody asked to end (`InterruptBehavior`), each with a warning as well."""
    replaced_by: str = ""
    fault: Fault | None = None
