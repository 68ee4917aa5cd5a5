"""BML blocks, the commands about them, what is told while they are performed, and their outcomes."""

from typing import Literal

from msgspec import Struct

from engage_hri.schemas.behaviors import BlockBehavior, Constraint
from engage_hri.schemas.faults import Fault
from engage_hri.schemas.requests import Outcome, Request
from engage_hri.schemas.units import Seconds, Stamp

WarningKind = Literal[
    "PARSING_FAILURE", "NO_SUCH_TARGET", "IMPOSSIBLE_TO_SCHEDULE", "BEHAVIOR_TYPE_NOT_SUPPORTED",
    "CUSTOM_BEHAVIOR_NOT_SUPPORTED", "CUSTOM_ATTRIBUTE_NOT_SUPPORTED",
    "CANNOT_CREATE_BEHAVIOR", "EXECUTION_FAILURE", "LATE", "POLICY",
    "INTERRUPTED", "DEGRADED",
]  # fmt: skip
"""CUSTOM_BEHAVIOR_NOT_SUPPORTED, CUSTOM_ATTRIBUTE_NOT_SUPPORTED: it is of a namespace that is not BML's.
DEGRADED: a behavior is performed with the nearest that the body has, or without a detail; nothing is dropped.
INTERRUPTED: a behavior was ended on request, or was held for too long; without a behavior: its block or all was.
POLICY: generation performs a fragment otherwise than it asks, for example with a less reliable reference."""


class BlockProgress(Struct, frozen=True, kw_only=True, tag="block_progress", omit_defaults=True):
    """evt: a block has started, or ended with a status.

    block: its id. time: seconds since the block's start. status: empty at its start.
    """

    block: str | None
    progress: Literal["start", "end"]
    at: Stamp
    time: Seconds = 0.0
    status: Literal["", "done", "failed", "interrupted"] = ""
    character_id: str = ""


class SyncPointProgress(Struct, frozen=True, kw_only=True, tag="sync_point_progress", omit_defaults=True):
    """evt: a sync point was realised. Each default point of each behavior exactly once, in order.

    sync: in the spelling of the block's dialect.
    at: instant as measured, but never before that of an earlier message about the block.
    time: the same in seconds since the block's start.
    predicted: time at which the last prediction had it. arrived: time at which the body came to it.
    skew: seconds after the first of the sync points that should be the same instant.
    source: `body`: the body reported it; `clock`: the realizer itself realised it.
    """

    block: str
    behavior: str
    sync: str
    at: Stamp
    time: Seconds
    predicted: Seconds | None = None
    arrived: Seconds | None = None
    skew: Seconds = 0.0
    source: Literal["body", "clock"] = "body"
    character_id: str = ""


class PlannedPoint(Struct, frozen=True, kw_only=True, omit_defaults=True):
    """A sync point with the time at which it is expected.

    time: seconds since the block's start. type: the BML element of its behavior.
    """

    behavior: str
    sync: str
    time: Seconds
    type: str = ""


class PredictionFeedback(Struct, frozen=True, kw_only=True, tag="prediction", omit_defaults=True):
    """evt: the expected times of a block's coming sync points.

    Sent when the block starts, and again when an expectation has moved noticeably.

    at: when the block started.
    """

    block: str
    points: tuple[PlannedPoint, ...]
    at: Stamp | None = None
    character_id: str = ""


class WarningFeedback(Struct, frozen=True, kw_only=True, tag="warning", omit_defaults=True):
    """evt: something was refused, dropped or done otherwise than asked.

    block: its id; null if it could not be read. behavior: id; empty: the warning is about the whole block.
    """

    block: str | None
    kind: WarningKind
    message: str
    behavior: str = ""
    at: Stamp | None = None
    character_id: str = ""

    @property
    def place(self) -> str:
        """Name of the thing that the warning is about: `block:behavior`, or the block alone."""
        return ":".join(part for part in (self.block, self.behavior) if part)


Feedback = BlockProgress | SyncPointProgress | PredictionFeedback | WarningFeedback


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
- continue: it goes on from there, whoever held it (but see `SteerPerformance.own`).
- stop: it ends safely; blocks end as interrupted.
"""


class SteerPerformance(Request, frozen=True, kw_only=True, tag="steer_performance", omit_defaults=True):
    """cmd: manager -> realizer: hold a block, let it continue, or stop it. Ends in `PerformanceSteered`.

    block: id of a live block. behavior: of that block; empty: all of it, so that to continue the block lets all its
    behaviors go, too. To hold a behavior that is past its last hold point is refused: it goes on to its end.
    own: to continue it lets go only what nobody but its requester holds.
    """

    to: Steer
    block: str
    behavior: str = ""
    own: bool = False


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


class Hold(Struct, frozen=True, kw_only=True, omit_defaults=True):
    """A hold that is in force.

    block: id of a live block; empty: all that the robot performs, and what comes. behavior: of that block; empty: all
    of it. since: when it began. until: when what it holds is stopped, unless somebody lets it go on before. why: what
    has happened, and whose it was; None: somebody has asked for it.
    """

    since: Stamp
    until: Stamp
    block: str = ""
    behavior: str = ""
    why: Fault | None = None

    def holds(self, other: "Hold") -> bool:
        """True if what the other holds is the same as what this one holds, or a part of it."""
        return not self.block or (self.block == other.block and self.behavior in ("", other.behavior))


class Held(Struct, frozen=True, kw_only=True, tag="held", omit_defaults=True):
    """state: realizer. All holds that are in force, the oldest first; none: nothing is held.

    Published at every change; a late subscriber gets the last one. Of a hold that is not among them any more, what it
    held goes on, or has ended.

    at: when it was published.
    """

    at: Stamp
    holds: tuple[Hold, ...] = ()


class BodyHeld(Struct, frozen=True, kw_only=True, tag="body_held", omit_defaults=True):
    """state: control. All behaviors that wait because whoever asked for them is not heard (`held_after`), the oldest
    first; none: nothing waits for that.

    Published at every change; a late subscriber gets the last one. Of a behavior that is not among them any more, its
    requester was heard again, or it has ended; `until` is when it ends otherwise.

    at: when it was published.
    """

    at: Stamp
    holds: tuple[Hold, ...] = ()

    @property
    def reasons(self) -> list[str]:
        """Reasons of these holds in words, each once."""
        return sorted({each.why.reason for each in self.holds if each.why is not None})


class NetPoint(Struct, frozen=True, kw_only=True, omit_defaults=True):
    """A sync point. behavior: empty for the start and the end of the block itself. sync: as the block spells it."""

    behavior: str = ""
    sync: str = ""

    def __str__(self) -> str:
        return f"{self.behavior or 'bml'}:{self.sync}"


class NetTransition(Struct, frozen=True, kw_only=True, omit_defaults=True):
    """An instant. points: those that share it. time: seconds from the block's start, as planned."""

    points: tuple[NetPoint, ...]
    time: Seconds = 0.0

    @property
    def name(self) -> str:
        """All points, as `gaze-1:stroke = point-1:start`."""
        return " = ".join(map(str, self.points))


class NetPlace(Struct, frozen=True, kw_only=True, omit_defaults=True):
    """A place between two transitions, named by their numbers.

    kind: `phase` of a behavior, `delay`, `order`, `series`, `handover` or `idle`. lag: least seconds that a token
    takes through it. behavior: the one that has this phase, or that waits there.
    """

    kind: str
    source: int
    target: int
    lag: Seconds = 0.0
    behavior: str = ""


class Fired(Struct, frozen=True, kw_only=True, omit_defaults=True):
    """A transition that has fired, `time` seconds after the block's start."""

    transition: int
    time: Seconds


class NetSpeech(Struct, frozen=True, kw_only=True, omit_defaults=True):
    """A speech of a block. behavior: its id. text: the words that it is to say."""

    behavior: str
    text: str


class NetPlanned(Struct, frozen=True, kw_only=True, tag="net_planned", omit_defaults=True):
    """stream: realizer: the net that a block runs on, and where its tokens are; all that a late watcher needs.

    Told at the block's start, when it is planned anew, and every two seconds. Points that the block's dialect gives
    one name are told once.
    at: when the block started. marked: numbers of the places that hold a token. fired: the transitions so far.
    speeches: what the block is to say, in the order of the block, also of speeches that were dropped.
    follows: ids of the blocks before it in the same turn that were live when it came.
    """

    block: str
    at: Stamp
    transitions: tuple[NetTransition, ...]
    places: tuple[NetPlace, ...]
    marked: tuple[int, ...] = ()
    fired: tuple[Fired, ...] = ()
    speeches: tuple[NetSpeech, ...] = ()
    follows: tuple[str, ...] = ()


class NetWaiting(Struct, frozen=True, kw_only=True, tag="net_waiting", omit_defaults=True):
    """stream: realizer: a block waits for its turn, since its composition asks for that; it has no net yet.

    Told when it begins to wait, whenever it waits for fewer, and every two seconds; then `NetPlanned` follows, or a
    `NetMarked` that says that it is over.
    since: when it began to wait. waits_for: ids of the live blocks that have to end before.
    """

    block: str
    since: Stamp
    waits_for: tuple[str, ...] = ()


class NetMarked(Struct, frozen=True, kw_only=True, tag="net_marked", omit_defaults=True):
    """stream: realizer: what has changed in the marking of a block's net since the last message.

    fired: transitions, in order. put: places that hold a token now and did not. taken: places that did and do not.
    is_over: the block has ended.
    """

    block: str
    fired: tuple[Fired, ...] = ()
    put: tuple[int, ...] = ()
    taken: tuple[int, ...] = ()
    is_over: bool = False
