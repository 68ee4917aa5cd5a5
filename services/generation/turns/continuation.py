"""What a turn's fragments leave for its next one to follow while they are still performed: points of live blocks.

Fragments of one turn are blocks at the same time. What one of them asks of the others is said here once: words
follow words, a gaze the glance before it, a stroke the stroke before it on the same arm.
"""

from collections.abc import Collection, Iterator
from typing import Literal

from msgspec import Struct

from engage_hri.schemas.behavior_types import canonical_sync
from engage_hri.schemas.behaviors import Behavior, Gesture, Hand, Head, Pointing
from engage_hri.schemas.references import type_name
from engage_hri.schemas.syncref import SYNC_POINTS

Limb = Hand | Literal["head"] | None
"""What a stroke is made with; None: whichever arm the body chooses."""
Reached = Collection[tuple[str, str]]
"""Behavior and sync point of all that was reached in a block."""


class Stroke(Struct, frozen=True):
    """over: its sync point from which on the limb is free for another."""

    behavior: str
    limb: Limb
    over: str = "stroke_end"


class Continuation(Struct, frozen=True):
    """Ids of a block's last speech or phrase, of its last glance and of its strokes. "": it has none.

    In the continuation of a turn they are `block:behavior`.
    """

    speech: str = ""
    glance: str = ""
    strokes: tuple[Stroke, ...] = ()

    @property
    def start(self) -> str:
        """The sync point that the next fragment takes for its block's start; "": the block's own."""
        return f"{self.speech}:end" if self.speech else ""

    def pending(self, block: str, reached: Reached) -> "Continuation":
        """Of this continuation of `block`, named from elsewhere, what has not been `reached`."""
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
        return Continuation(later.speech or self.speech, later.glance or self.glance, (*self.strokes, *later.strokes))

    def frees(self, limb: Limb) -> Iterator[str]:
        """The sync points before which `limb` is in use."""
        return (f"{each.behavior}:{each.over}" for each in self.strokes if _may_be_one(each.limb, limb))


NO_CONTINUATION = Continuation()


def stroke(behavior: Behavior, hand: Hand | None = None) -> Stroke | None:
    """The stroke of a behavior, if that is what it is made for. hand: the one it is made with if it names none."""
    match behavior:
        case Pointing(mode=mode) | Gesture(mode=mode):
            return Stroke(behavior.id, mode or hand)
        case Head():
            return Stroke(behavior.id, "head", over="end")
    return None


def first_met(behavior: Behavior, named: Collection[tuple[str, str]]) -> str:
    """The sync point of `behavior` that the words before its fragment must not come after: its start, as a rule.

    Whose stroke is tied to something may set out before, so that it meets the first words: the realizer knows when.
    named: behavior and sync point of all that the fragment names.
    """
    type = type_name(behavior)
    syncs = {canonical_sync(sync, type) for id, sync in named if id == behavior.id}
    first = next((sync for sync in SYNC_POINTS if sync in syncs), "start")
    return first if first in ("stroke_start", "stroke") and type != "speech" else "start"


def _may_be_one(one: Limb, other: Limb) -> bool:
    if "head" in (one, other):
        return one == other
    return one == other or None in (one, other) or "BOTH_HANDS" in (one, other)
