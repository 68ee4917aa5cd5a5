"""Continuation of a turn: the sync points of blocks under way that the turn's next fragment has to follow.

The fragments of one turn are blocks that live at the same time. Between them hold three rules: words follow words, a
gaze follows the glance before it, and a stroke follows the stroke before it on the same arm.
"""

from collections.abc import Collection, Iterator
from typing import Literal

from msgspec import Struct
from msgspec.structs import replace

from engage_hri.schemas.behavior_types import SYNC_POINTS, canonical_sync
from engage_hri.schemas.behaviors import Behavior, Gesture, Hand, Head, Pointing
from engage_hri.schemas.references import type_name
from engage_hri.schemas.units import Seconds

Limb = Hand | Literal["head"] | None
"""Part of the body that makes a stroke; None: either arm, as the body chooses."""
Reached = Collection[tuple[str, str]]
"""Behavior and sync point of all that was reached in a block."""


class Stroke(Struct, frozen=True):
    """The stroke of a behavior. over: its sync point from which on the limb is free for another one."""

    behavior: str
    limb: Limb
    over: str = "stroke_end"


class Continuation(Struct, frozen=True):
    """Ids of a block's last speech or phrase, of its last glance and of its strokes. "": it has none.

    In the continuation of a turn, which joins those of several blocks, the ids are `block:behavior`.
    """

    speech: str = ""
    glance: str = ""
    strokes: tuple[Stroke, ...] = ()
    seen_after: Seconds = 0.0
    """Seconds from now for which the eyes stay at least on what they have just come to."""
    eyes_on: str = ""
    """What that is."""

    @property
    def start(self) -> str:
        """The sync point that the next fragment takes for its block's start; "": the block's own."""
        return f"{self.speech}:end" if self.speech else ""

    def pending(self, block: str, reached: Reached) -> "Continuation":
        """The part of this continuation of `block` that has not been `reached`, with ids for use in other blocks."""
        ahead = tuple(
            Stroke(f"{block}:{each.behavior}", each.limb, each.over)
            for each in self.strokes
            if (each.behavior, each.over) not in reached
        )
        return Continuation(
            speech=f"{block}:{self.speech}" if self.speech and (self.speech, "end") not in reached else "",
            glance=f"{block}:{self.glance}" if self.glance and (self.glance, "stroke") not in reached else "",
            strokes=ahead,
        )

    def then(self, later: "Continuation") -> "Continuation":
        """Join this continuation with that of a later block: its words and glance go before."""
        strokes = (*self.strokes, *later.strokes)
        return replace(self, speech=later.speech or self.speech, glance=later.glance or self.glance, strokes=strokes)

    def frees(self, limb: Limb) -> Iterator[str]:
        """The sync points up to which strokes use `limb`, or may use it."""
        return (f"{each.behavior}:{each.over}" for each in self.strokes if _may_be_one(each.limb, limb))


NO_CONTINUATION = Continuation()


def stroke(behavior: Behavior, hand: Hand | None = None) -> Stroke | None:
    """The stroke of a pointing, gesture or head movement; None for others. hand: for a behavior that names none."""
    match behavior:
        case Pointing(mode=mode) | Gesture(mode=mode):
            return Stroke(behavior.id, mode or hand)
        case Head():
            return Stroke(behavior.id, "head", over="end")
    return None


def first_met(behavior: Behavior, named: Collection[tuple[str, str]]) -> str:
    """The sync point of `behavior` that has to come after the words before its fragment: its start, as a rule.

    A behavior with a stroke that is tied to something has to have only the stroke after them: it may set out before,
    so that the stroke meets the first words. named: behavior and sync point of all that the fragment names.
    """
    type = type_name(behavior)
    syncs = {canonical_sync(sync, type) for id, sync in named if id == behavior.id}
    first = next((sync for sync in SYNC_POINTS if sync in syncs), "start")
    return first if first in ("stroke_start", "stroke") and type != "speech" else "start"


def _may_be_one(one: Limb, other: Limb) -> bool:
    """True unless these are certainly different limbs."""
    if "head" in (one, other):
        return one == other
    return one == other or None in (one, other) or "BOTH_HANDS" in (one, other)
