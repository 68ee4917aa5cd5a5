"""Turn fragments: what a collaboration manager hands to generation, and the outcome it gets back."""

from typing import Literal

from msgspec import Struct

from engage_hri.schemas.behaviors import Action, Constraint, FragmentBehavior
from engage_hri.schemas.blocks import SpokenText, Unread
from engage_hri.schemas.faults import Fault
from engage_hri.schemas.recognition import ConnectionEvent
from engage_hri.schemas.requests import Outcome, Request
from engage_hri.schemas.units import Probability, Seconds

TurnStatus = Literal["beginning", "middle", "end", "full", "backchannel"]
GestureChoice = Literal["none", "gaze", "directed_gaze", "directed_gaze_with_pointing"]


class TurnFragment(Struct, frozen=True, kw_only=True, tag="fragment", omit_defaults=True):
    """Part or whole of a turn. Thesis 3.2.

    id: the manager's name for it; no other live fragment has it.
    turn_index: first, second or third turn of an adjacency pair.
    turn_status: a whole turn (`full`), a piece of one (`beginning`, `middle`, `end`), or a `backchannel`
    while another speaks.
    behaviors: speech and references one after the other as written, others as their timing says.
    constraints: between sync points of these behaviors.
    addressee: id of the person spoken to; empty: the only person the world knows.
    delay: hold the turn after this fragment while the manager thinks, eyes on `delay_target`.
    delay_target: id of an entity; empty: a surface, away from the face.
    accept: which actions answer the adjacency pair this turn starts; empty: recognition's default.
    line: of its XML source, from 1; 0 when there is none.
    """

    id: str
    turn_index: Literal[1, 2, 3] = 1
    turn_status: TurnStatus = "full"
    behaviors: tuple[FragmentBehavior, ...] = ()
    constraints: tuple[Constraint, ...] = ()
    addressee: str = ""
    delay: bool = False
    delay_target: str = ""
    accept: tuple[Action, ...] = ()
    unread: tuple[Unread, ...] = ()
    """Warned of when the block that it becomes begins."""
    from_parts: bool = False
    """Of a language model's tool call, each behavior of one part: refusals name the part (`schemas/tool_call.py`)."""
    line: int = 0


class PerformFragment(Request, frozen=True, kw_only=True, tag="perform_fragment", omit_defaults=True):
    """cmd: collaboration -> generation. Terminal state: `FragmentOutcome`."""

    fragment: TurnFragment


class PairConsidered(Struct, frozen=True, kw_only=True, omit_defaults=True):
    """One row of the table behind a choice: a gesture-speech pair with its numbers and its verdict."""

    gesture: GestureChoice
    phrase: str
    distractors: tuple[str, ...]
    channel: float
    reliability: float
    minimum: float
    cost: Seconds
    feasible: bool
    chosen: bool = False
    reason: str = ""


class ReferenceChoice(Struct, frozen=True, kw_only=True, omit_defaults=True):
    """How a reference was made, and every pair that was considered. Thesis 3.3.2.

    Where no pair can be performed none is chosen, and the fragment has failed.
    """

    reference: str
    target: str
    gesture: GestureChoice
    phrase: str
    reliability: Probability
    cost: Seconds
    pairs: tuple[PairConsidered, ...] = ()


class FragmentOutcome(Outcome, frozen=True, kw_only=True, tag="fragment_outcome", omit_defaults=True):
    """evt: generation -> requester. What became of a fragment, when its block has ended and its gazes are decided.

    fragment: its id. status: done, failed while it ran, or ended by somebody.
    spoken: the words that were really said.
    replaced_by: the block whose `REPLACE` ended it, if interrupted so.
    choices: how each reference was made. warnings: what was done otherwise than asked.
    fault: why it failed.
    """

    fragment: str
    status: Literal["done", "failed", "interrupted"]
    spoken: tuple[SpokenText, ...] = ()
    replaced_by: str = ""
    events: tuple[ConnectionEvent, ...] = ()
    """Each connection event of the turn in its last known state, by start."""
    choices: tuple[ReferenceChoice, ...] = ()
    warnings: tuple[str, ...] = ()
    fault: Fault | None = None


class TurnClosed(Struct, frozen=True, kw_only=True, tag="turn_closed", omit_defaults=True):
    """evt: generation. Once for each turn of the robot, when all its fragments have ended and its pair is decided.

    turn: id of the fragment that opened it. aborted: barge-in, fault, cancellation or silence ended it; `reason`.
    """

    turn: str
    addressee: str
    status: Literal["done", "aborted"]
    reason: str = ""
    fragments: tuple[str, ...] = ()
    spoken: tuple[SpokenText, ...] = ()
    """Of all its fragments, in their order; speeches named `fragment:behavior`."""
    events: tuple[ConnectionEvent, ...] = ()
    """Each connection event of the turn in its last known state, by start."""
