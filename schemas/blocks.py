"""BML blocks, the commands about them, and their outcomes."""

from typing import Literal

from msgspec import Struct

from engage_hri.schemas.behaviors import BlockBehavior, Constraint
from engage_hri.schemas.faults import Fault
from engage_hri.schemas.feedback import WarningKind
from engage_hri.schemas.requests import Outcome, Request

Composition = Literal["MERGE", "APPEND", "REPLACE"]
Dialect = Literal["draft", "bml-1.0"]


class Unread(Struct, frozen=True, kw_only=True, omit_defaults=True):
    """Something in a block that its reader did not understand and left out.

    behavior: id of the behavior that held it; empty: the block itself.
    """

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
    """Character that its author wants to perform it. Feedback repeats the name; the robot performs any block."""
    unread: tuple[Unread, ...] = ()
    """Parts of the document that were left out. The realizer warns of each when the block begins."""


class PerformBlock(Request, frozen=True, kw_only=True, tag="perform_block", omit_defaults=True):
    """cmd: collaboration or generation -> realizer. Terminal state: `BlockOutcome`.

    follows: ids of the live blocks before it in the same turn. When one of them fails, is refused or is interrupted,
    this block is interrupted in the same instant; its outcome comes after that one. Refused if one is not live.
    """

    block: Block
    follows: tuple[str, ...] = ()


class InterruptBehavior(Request, frozen=True, kw_only=True, tag="interrupt_behavior", omit_defaults=True):
    """cmd: anyone -> realizer: end one behavior of a live block now. Terminal state: `BehaviorInterrupted`.

    The other behaviors go on. A gesture relaxes, a speech ends after a word. Sync points that the behavior has not
    reached count as if they had not been written, and its block does not fail, even if it is required. To end a whole
    block, cancel its request.
    """

    block: str
    behavior: str


class BehaviorInterrupted(Outcome, frozen=True, kw_only=True, tag="behavior_interrupted", omit_defaults=True):
    """evt: realizer -> requester: the behavior has ended.

    spoken: of a speech, the words that were said.
    was_done: it had ended by itself before.
    """

    block: str
    behavior: str
    spoken: str = ""
    was_done: bool = False


Steer = Literal["hold", "continue", "stop"]
"""What a performance is told.

- hold: every behavior waits where it next can, at a hold point or between two words; nothing begins, clocks stop,
  nothing counts as late for it. What is held for longer than `realizer.longest_hold` is stopped.
- continue: it goes on from there, whoever held it.
- stop: it ends safely; blocks end as interrupted.
"""


class SteerPerformance(Request, frozen=True, kw_only=True, tag="steer_performance", omit_defaults=True):
    """cmd: manager -> realizer: hold a block, let it continue, or stop it. Ends in `PerformanceSteered`.

    block: id of a live block. behavior: of that block; empty: all of it, so that to continue the block lets all its
    behaviors go, too. To hold a behavior that is past its last hold point is refused: it goes on to its end.
    """

    to: Steer
    block: str
    behavior: str = ""


class SteerRobot(Request, frozen=True, kw_only=True, tag="steer_robot", omit_defaults=True):
    """cmd: operator, wizard -> realizer: the same for all that the robot performs. Ends in `PerformanceSteered`.

    What comes while the robot is held waits, too. To continue the robot lets everything go.
    """

    to: Steer


class PerformanceSteered(Outcome, frozen=True, kw_only=True, tag="performance_steered", omit_defaults=True):
    """evt: realizer -> requester: what was asked for has been commanded; of a stop, it has ended.

    blocks: ids of the live blocks that it concerns; none, if what was to continue is held as a part of more.
    held_with: that more, of which it is a part: its block, or the whole robot. Empty: it is held no longer.
    """

    blocks: tuple[str, ...] = ()
    held_with: Literal["", "block", "robot"] = ""


class SpokenText(Struct, frozen=True, kw_only=True, omit_defaults=True):
    """Words of a speech that were said: all of them, or those before the interruption."""

    behavior: str
    text: str
    complete: bool = True


class BlockOutcome(Outcome, frozen=True, kw_only=True, tag="block_outcome", omit_defaults=True):
    """evt: realizer -> requester: the end of a block. Exactly one for each accepted block.

    replaced_by: the block whose `REPLACE` ended it, if its status is `interrupted` for that reason.
    fault: why it failed; also if it had behaviors and every one was dropped.
    """

    block: str
    status: Literal["done", "failed", "interrupted"]
    spoken: tuple[SpokenText, ...] = ()
    dropped: tuple[str, ...] = ()
    """Ids of behaviors that were dropped, each with its warning on the feedback stream."""
    reasons: tuple[str, ...] = ()
    """Reasons for the dropped behaviors, in the same order, in the words of the warnings."""
    interrupted: tuple[str, ...] = ()
    """Ids of behaviors that were ended by `InterruptBehavior`, each with a warning as well."""
    replaced_by: str = ""
    fault: Fault | None = None
